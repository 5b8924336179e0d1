"""Attitude and body-rate control for a client that steers by SET_ATTITUDE_TARGET, as a flight stack has it.

Attitude error -> body rates -> moments, in cascade. The tilt comes before the heading: where the thrust
points decides where the vehicle goes. The inner gain follows from the lag of rotors and loop.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.law.allocation import ALLOCATION, MOST_ROTORS, allocate
from controller.law.control_law import WORK
from controller.law.state import STATE_SIZE, WRENCH_SIZE, Array
from controller.law.terms import DELAY, FEEDFORWARD_TERM, INTEGRAL, PROPORTIONAL, SATURATED
from sitl_bridge.compiled import Buffer, entry_point, kernel
from sitl_bridge.frames import Triple
from sitl_bridge.vehicle.description import Vehicle

ATTITUDE_LAW = np.dtype(
    [
        ("period", "f8"),  # s
        ("inertia", "f8", 3),  # kg m², about the body's axes
        ("rate_gain", "f8", 3),  # 1/s, angular acceleration per error of the rate
        ("rate_integral_gain", "f8", 3),  # 1/s²
        ("attitude_gain", "f8", 3),  # 1/s, rate per error of the angle
        ("largest_rate", "f8", 3),  # rad/s, that an attitude may ask for
        # What is asked for:
        ("has_attitude", "i8"),
        ("attitude", "f8", 4),  # FLU to ENU, w x y z
        ("rate", "f8", 3),  # rad/s FLU; beside an attitude a feed-forward; NaN: none, or as it is
        ("thrust", "f8"),  # N, of all rotors together
        # Memory:
        ("integral", "f8", 3),  # rad/s²
    ]
)

AttitudeLaw = NDArray[np.void]

LAG_SHARE = 2.5
"""The rate loop's time constant, in lags of rotors and loop: damped well, with some phase in hand"""
FASTEST_RATE_GAIN = 16.0
"""1/s, however fast the rotors are"""
INTEGRAL_SHARE = 1.3
"""1/s, integral over proportional gain, as PX4's defaults have it"""
LARGEST_INTEGRAL = 5.0
"""rad/s²"""
CASCADE = 2.0
"""The attitude's gain is at least so many times smaller than that of the rates"""


def attitude_law(vehicle: Vehicle, rate_hz: float) -> AttitudeLaw:
    """The law of a vehicle as a record of shape (1,), at rest; the client's part is to be filled in."""
    law = np.zeros(1, dtype=ATTITUDE_LAW)
    lag = max(rotor.time_constant for rotor in vehicle.rotors) + (1 + vehicle.loop.delay_ticks) / rate_hz
    gain = min(FASTEST_RATE_GAIN, 1.0 / (LAG_SHARE * lag))
    law["period"] = 1.0 / rate_hz
    law["inertia"] = vehicle.airframe.inertia
    law["rate_gain"] = gain
    law["rate_integral_gain"] = INTEGRAL_SHARE * gain
    law["attitude"] = (1.0, 0.0, 0.0, 0.0)
    return law


def set_limits(law: AttitudeLaw, gains: Triple, rates: Triple) -> None:
    """Gains of roll, pitch, yaw (1/s), as far as the rate loop bears them, and largest rates (rad/s)."""
    law["attitude_gain"] = np.minimum(gains, law["rate_gain"][0] / CASCADE)
    law["largest_rate"] = rates


@kernel
def _attitude_error(roll: float, pitch: float, yaw: float, q: Array, error: Array) -> None:
    """Rotation (rad, about the body's axes) from an attitude to a wanted one: tilt first, then heading."""
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    sy, cy = math.sin(yaw), math.cos(yaw)
    # Columns of the body's axes in the world, as they are.
    x0, x1, x2 = cy * cp, sy * cp, -sp
    y0, y1, y2 = cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr
    z0, z1, z2 = cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr
    w, x, y, z = q[0], q[1], q[2], q[3]
    # As they are to be.
    a0, a1, a2 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)
    b0, b1, b2 = 2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)
    c0, c1, c2 = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)
    # The wanted thrust axis in the body, and the turn that takes ours there.
    to_x = x0 * c0 + x1 * c1 + x2 * c2
    to_y = y0 * c0 + y1 * c1 + y2 * c2
    to_z = z0 * c0 + z1 * c1 + z2 * c2
    sine = math.hypot(to_x, to_y)
    angle = math.atan2(sine, to_z)
    if sine > 1e-9:
        error[0], error[1] = -angle * to_y / sine, angle * to_x / sine
    else:
        error[0], error[1] = angle, 0.0  # upside down any axis will do
    # What is left is a turn about the thrust axis.
    left = (y0 * a0 + y1 * a1 + y2 * a2) - (x0 * b0 + x1 * b1 + x2 * b2)
    right = (x0 * a0 + x1 * a1 + x2 * a2) + (y0 * b0 + y1 * b1 + y2 * b2)
    error[2] = math.atan2(left, right) if left * left + right * right > 1e-18 else 0.0


@entry_point(
    Buffer(ATTITUDE_LAW, (1,)),
    Buffer(ALLOCATION, (1,)),
    Buffer(WORK, (1,)),
    Buffer(np.float64, (STATE_SIZE,)),
    Buffer(np.float64, (MOST_ROTORS,)),
)
def attitude_step(laws: Any, allocations: Any, works: Any, estimate: Array, controls: Array) -> int:
    """Rotor commands (16,), 0..1, for an estimate (18,), eq. 31; returns 1 when a rotor limit was met."""
    law, work = laws[0], works[0]
    rates, wrench = estimate[12:15], work.wrench
    error, terms = work.integral, work.terms  # error: scratch here, (3,)
    terms[PROPORTIONAL, 0] = terms[INTEGRAL, 0] = 0.0
    if law.has_attitude:
        _attitude_error(estimate[15], estimate[16], estimate[17], law.attitude, error)
    for i in range(3):
        asked = law.rate[i]
        if law.has_attitude:
            forward = asked if math.isfinite(asked) else 0.0
            asked = law.attitude_gain[i] * error[i] + forward
            asked = min(max(asked, -law.largest_rate[i]), law.largest_rate[i])
        elif not math.isfinite(asked):
            asked = rates[i]
        error[i] = asked - rates[i]
        wrench[1 + i] = law.inertia[i] * (law.rate_gain[i] * error[i] + law.integral[i])
        terms[PROPORTIONAL, 1 + i] = law.inertia[i] * law.rate_gain[i] * error[i]
        terms[INTEGRAL, 1 + i] = law.inertia[i] * law.integral[i]
    # The gyroscopic moment of the turning body.
    h0, h1, h2 = law.inertia[0] * rates[0], law.inertia[1] * rates[1], law.inertia[2] * rates[2]
    wrench[1] += rates[1] * h2 - rates[2] * h1
    wrench[2] += rates[2] * h0 - rates[0] * h2
    wrench[3] += rates[0] * h1 - rates[1] * h0
    wrench[0] = law.thrust
    limited = allocate(allocations[0], wrench, controls, work.achieved, work.rotors)
    for k in range(WRENCH_SIZE):
        terms[FEEDFORWARD_TERM, k] = wrench[k] - terms[PROPORTIONAL, k] - terms[INTEGRAL, k]
        terms[DELAY, k] = 0.0
        terms[SATURATED, k] = work.achieved[k] - wrench[k]
    for i in range(3):
        step = 0.0 if limited else law.period * law.rate_integral_gain[i] * error[i]
        law.integral[i] = min(max(law.integral[i] + step, -LARGEST_INTEGRAL), LARGEST_INTEGRAL)
    return 1 if limited else 0
