"""Feed-forward: the motion of the vehicle, its attitude and thrust that belong to a motion of the load.

The load's position is a flat output: its acceleration says how hard and which way the cable pulls, hence
where the vehicle is; the vehicle's acceleration says how hard and which way it thrusts, hence its attitude.
Both count their drag in still air: any wind is left to the integrator.
The attitude's own acceleration says what moments that takes. Gains scale with the inertia, so even a small
one counts. Time derivatives along the path are central differences over a few milliseconds, exact to the
path's own smoothness.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from controller.law.reference import DERIVATIVES, OTHER_LAGS, derivative, feasible, piece_at
from controller.law.state import Array
from sitl_bridge.compiled import kernel
from sitl_bridge.vehicle.description import Vehicle

STENCIL_STEP = 2e-3
"""Spacing of the central differences, s."""

LEAST_PULL = 1e-3
"""Of the load's weight, upwards: planned motions but those that begin with a slack cable keep far above."""

LAGS_TO_REST = 30.0
"""Time constants of the cable after which its stretch is that of hover, to the last digits."""

POINTS = 5
STENCIL = np.dtype(
    [
        ("derivatives", "f8", (DERIVATIVES + 1, 3)),
        ("profile", "f8", DERIVATIVES + 1),
        ("load", "f8", (POINTS, 3)),  # m
        ("vehicle", "f8", (POINTS, 3)),  # m
        ("pull", "f8", (POINTS, 3)),  # N, of the cable on the load
        ("force", "f8", (POINTS, 3)),  # N, that the rotors have to give
        ("thrust", "f8", POINTS),  # N
        ("later", "f8", 4),  # N and N m, thrust and moments a little later
        ("attitude", "f8", (POINTS, 3)),  # roll, pitch, and yaw from the path's own, rad
    ]
)

BODY = np.dtype(
    [
        ("gravity", "f8"),
        ("vehicle_mass", "f8"),
        ("inertia", "f8", 3),
        ("load_mass", "f8"),
        ("stiffness", "f8"),
        ("damping", "f8"),
        ("rest_length", "f8"),
        ("vehicle_drag", "f8", 2),  # N s/m and N s²/m²
        ("load_drag", "f8", 2),
        ("pace", "f8"),  # at which it goes along a planned path
        ("planned_load_mass", "f8"),  # with which a path's lengths were planned
        ("planned_stiffness", "f8"),
    ]
)


def body(vehicle: Vehicle, loaded: bool = True) -> np.void:
    """What the feed-forward needs to know of a vehicle, with its load or alone, SI units."""
    cable, airframe, load = vehicle.cable, vehicle.airframe, vehicle.load
    record = np.zeros(1, dtype=BODY)
    record[0] = (
        vehicle.gravity,
        airframe.mass,
        airframe.inertia,
        load.mass if loaded else 0.0,
        cable.stiffness,
        cable.damping,
        cable.rest_length,
        (airframe.drag.linear, airframe.drag.quadratic),
        (load.drag.linear, load.drag.quadratic),
        1.0,
        load.mass if loaded else 0.0,
        cable.stiffness,
    )
    out: np.void = record[0]
    return out


@kernel
def _along(b: Any, path: Any, t: float, stencil: Any) -> None:
    """The stencil's derivatives are those of the path at time t (s), at the body's pace."""
    feasible(path, t * b.pace, stencil.derivatives, stencil.profile)
    if b.pace != 1.0:
        scale = 1.0
        for k in range(1, DERIVATIVES + 1):
            scale *= b.pace
            for i in range(3):
                stencil.derivatives[k, i] *= scale


@kernel
def _planned_length(b: Any, path: Any, t: float, now: Any, planned: Any) -> float:
    """Length of the cable, m, at time t (s) of a path that gives it, for a vehicle other than planned for.

    now, planned: tension, N, and its slope, N/s; planned is what the description and the plan's pace give.
    Behind the ramp the tension is constant, and the damper lets the rest of the stretch go.
    """
    lag, planned_lag, ramp_time = b.damping / b.stiffness, path.cable_lag / b.pace, path.ramp_time / b.pace
    # Between the planned lags: a parabola over their ratio's logarithm.
    ratio = min(max(math.log(lag / planned_lag) / math.log(OTHER_LAGS[2]), -1.5), 1.5) if lag > 0.0 else -1.5
    share = (t if path.departs else max(0.0, t)) / ramp_time
    piece = piece_at(path.pieces, min(1.0, share))
    stretch = 0.0
    for i in range(3):
        length = derivative(path.lengths[i, piece], min(1.0, share) * path.pieces - piece, 0)
        if t > ramp_time:
            at_rest = b.rest_length + planned[0] / b.planned_stiffness
            length = at_rest + (length - at_rest) * math.exp((ramp_time - t) / (OTHER_LAGS[i] * planned_lag))
        weight = 1.0 - ratio * ratio if i == 1 else 0.5 * ratio * (ratio + i - 1.0)
        stretch += weight * (length - b.rest_length)
    # Of (1 + lag d/dt)⁻¹ F/k with another F and k: to first order in F.
    stretch *= 1.0 - lag * (now[1] / now[0] - planned[1] / planned[0])
    return float(b.rest_length + stretch * now[0] / planned[0] * b.planned_stiffness / b.stiffness)


@kernel
def _tension(b: Any, r: Array, mass: float, pace: float, pull: Array) -> tuple[float, float, float]:
    """Tension, N, and two derivatives for the load's derivatives r (6, 3) at another pace; writes pull.

    The second one leaves out how the drag coefficient's slope changes.
    """
    squared, slope, bend = 0.0, 0.0, 0.0
    speed = pace * math.sqrt(r[1, 0] ** 2 + r[1, 1] ** 2 + r[1, 2] ** 2)
    drag = b.load_drag[0] + b.load_drag[1] * speed
    along = pace**3 * (r[1, 0] * r[2, 0] + r[1, 1] * r[2, 1] + r[1, 2] * r[2, 2])
    gaining = b.load_drag[1] * along / speed if speed > 0.0 else 0.0  # the drag coefficient's derivative
    for i in range(3):
        velocity, acceleration, jerk = pace * r[1, i], pace**2 * r[2, i], pace**3 * r[3, i]
        upward = acceleration + (b.gravity if i == 2 else 0.0)
        pull[i] = mass * upward + drag * velocity
        if i == 2:  # a cable that is about to pull has a direction
            pull[i] = max(pull[i], LEAST_PULL * mass * b.gravity)
        squared += pull[i] * pull[i]
        pulling = mass * jerk + drag * acceleration + gaining * velocity
        bending = mass * pace**4 * r[4, i] + drag * jerk + 2.0 * gaining * acceleration
        slope += pull[i] * pulling
        bend += pulling * pulling + pull[i] * bending
    tension = math.sqrt(squared)
    slope /= tension
    return tension, slope, (bend - slope * slope) / tension


@kernel
def _hang(b: Any, path: Any, t: float, r: Array, load: Array, vehicle: Array, pull: Array) -> None:
    """Where the vehicle is for the load's derivatives r (6, 3) at time t (s), and how the cable pulls it.

    Without a load the derivatives are the vehicle's own.
    """
    if b.load_mass == 0.0:
        for i in range(3):
            load[i] = vehicle[i] = r[0, i]
            pull[i] = 0.0
        return
    if path.cable_lag > 0.0:
        planned = _tension(b, r, b.planned_load_mass, 1.0 / b.pace, pull)
        tension = _tension(b, r, b.load_mass, 1.0, pull)
        length = _planned_length(b, path, t, tension, planned)
    else:
        tension = _tension(b, r, b.load_mass, 1.0, pull)
        # l = l_0 + F/k - (c/k) l', with l' = F'/k to first order, along a path of known snap to second.
        lag = b.damping / b.stiffness
        bend = 0.0 if path.local else lag * tension[2]
        length = b.rest_length + (tension[0] - lag * (tension[1] - bend)) / b.stiffness
    for i in range(3):
        load[i] = r[0, i]
        vehicle[i] = r[0, i] + length * pull[i] / tension[0]


@kernel
def _swing(x: float, y: float, z: float, attitude: Array) -> None:
    """Roll, pitch and yaw (3,) of the shortest turn from upright to a thrust along (x, y, z), a unit vector.

    It takes no moment about the vehicle's own axis, the one that rotors are worst at.
    """
    upright = 1.0 + z
    attitude[0] = math.atan2(-y, z)
    attitude[1] = math.asin(x)
    attitude[2] = math.atan2(-x * y / upright, 1.0 - x * x / upright)


@kernel
def _lean(b: Any, path: Any, t: float, heading: Array, stencil: Any) -> None:
    """Load, vehicle and cable around time t (s), and around it thrust and tilt: the stencil's points.

    heading: (2,), cosine and sine of the path's yaw; roll and pitch are towards this heading.
    """
    h = STENCIL_STEP
    for j in range(POINTS):
        at = t + (j - POINTS // 2) * h
        _along(b, path, at, stencil)
        _hang(b, path, at, stencil.derivatives, stencil.load[j], stencil.vehicle[j], stencil.pull[j])
    for j in range(1, POINTS - 1):
        squared = 0.0
        for i in range(3):
            squared += (stencil.vehicle[j + 1, i] - stencil.vehicle[j - 1, i]) ** 2
        drag = b.vehicle_drag[0] + b.vehicle_drag[1] * math.sqrt(squared) / (2.0 * h)
        for i in range(3):
            before, here, after = stencil.vehicle[j - 1, i], stencil.vehicle[j, i], stencil.vehicle[j + 1, i]
            acceleration = (before - 2.0 * here + after) / (h * h)
            resistance = drag * (after - before) / (2.0 * h)
            stencil.force[j, i] = b.vehicle_mass * acceleration + stencil.pull[j, i] + resistance
        stencil.force[j, 2] += b.vehicle_mass * b.gravity
        east, north, z = stencil.force[j, 0], stencil.force[j, 1], stencil.force[j, 2]
        x, y = heading[0] * east + heading[1] * north, heading[0] * north - heading[1] * east
        stencil.thrust[j] = math.sqrt(x * x + y * y + z * z)
        if path.pieces > 0:
            _swing(x / stencil.thrust[j], y / stencil.thrust[j], z / stencil.thrust[j], stencil.attitude[j])
        else:
            stencil.attitude[j, 0] = -math.asin(y / stencil.thrust[j])
            stencil.attitude[j, 1] = math.atan2(x, z)
            stencil.attitude[j, 2] = 0.0


@kernel
def _body_rates(stencil: Any, yaw_rate: float) -> tuple[float, float, float]:
    """Body rates p, q, r (rad/s) at the stencil's middle, from Euler rates (eq. 14)."""
    h = STENCIL_STEP
    roll, pitch = stencil.attitude[2, 0], stencil.attitude[2, 1]
    roll_rate = (stencil.attitude[3, 0] - stencil.attitude[1, 0]) / (2.0 * h)
    pitch_rate = (stencil.attitude[3, 1] - stencil.attitude[1, 1]) / (2.0 * h)
    turning = yaw_rate + (stencil.attitude[3, 2] - stencil.attitude[1, 2]) / (2.0 * h)
    upright = math.cos(pitch) * turning
    return (
        roll_rate - math.sin(pitch) * turning,
        math.cos(roll) * pitch_rate + math.sin(roll) * upright,
        -math.sin(roll) * pitch_rate + math.cos(roll) * upright,
    )


@kernel
def _moments(b: Any, stencil: Any, yaw_rate: float, wrench: Array) -> None:
    """M = I w' + w x I w at the stencil's middle: wrench[1:4], N m. The path's yaw rate is constant."""
    h = STENCIL_STEP
    before, here, after = stencil.attitude[1], stencil.attitude[2], stencil.attitude[3]
    roll, pitch = here[0], here[1]
    d_roll, d_pitch = (after[0] - before[0]) / (2.0 * h), (after[1] - before[1]) / (2.0 * h)
    d_yaw = yaw_rate + (after[2] - before[2]) / (2.0 * h)
    dd_roll = (after[0] - 2.0 * roll + before[0]) / (h * h)
    dd_pitch = (after[1] - 2.0 * pitch + before[1]) / (h * h)
    dd_yaw = (after[2] - 2.0 * here[2] + before[2]) / (h * h)
    s_roll, c_roll, s_pitch, c_pitch = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    dp = dd_roll - c_pitch * d_pitch * d_yaw - s_pitch * dd_yaw
    dq = (
        c_roll * dd_pitch
        - s_roll * d_roll * d_pitch
        + (c_roll * d_roll * c_pitch - s_roll * s_pitch * d_pitch) * d_yaw
        + s_roll * c_pitch * dd_yaw
    )
    dr = (
        -s_roll * dd_pitch
        - c_roll * d_roll * d_pitch
        - (s_roll * d_roll * c_pitch + c_roll * s_pitch * d_pitch) * d_yaw
        + c_roll * c_pitch * dd_yaw
    )
    p, q, r = _body_rates(stencil, yaw_rate)
    i_x, i_y, i_z = b.inertia[0], b.inertia[1], b.inertia[2]
    wrench[1] = i_x * dp + (i_z - i_y) * q * r
    wrench[2] = i_y * dq + (i_x - i_z) * r * p
    wrench[3] = i_z * dr + (i_y - i_x) * p * q


@kernel
def flat_motion(
    b: Any,
    path: Any,
    t: float,
    lead: float,
    lag: float,
    heading: Array,
    stencil: Any,
    state: Array,
    wrench: Array,
) -> None:
    """x* (18,), eq. 31, at time t (s), and u* (4,) at t + lead, for a feasible path.

    Lagging rotors (lag, s) are asked for u + lag·u' along a planned profile, whose seventh derivative is
    bounded. Along any other path they are asked for u a lag ahead, the same to first order.
    heading: (2,), cosine and sine of the path's yaw; roll and pitch of x* are towards this heading. Along a
    planned profile the vehicle turns without twisting, which takes its nose a few degrees off the heading.
    """
    h = STENCIL_STEP
    for i in range(18):
        state[i] = 0.0
    state[17] = path.yaw
    at_rest = path.ramp_time / b.pace + (POINTS // 2) * h + LAGS_TO_REST * path.cable_lag / b.pace
    if not path.local and path.radius == 0.0 and t > at_rest:
        _along(b, path, t, stencil)
        _hang(b, path, t, stencil.derivatives, stencil.load[2], stencil.vehicle[2], stencil.pull[2])
        weight = (b.vehicle_mass + b.load_mass) * b.gravity
        for i in range(3):
            state[i] = stencil.vehicle[2, i]
            state[3 + i] = stencil.load[2, i]
            stencil.force[2, i] = weight if i == 2 else 0.0
        wrench[0], wrench[1], wrench[2], wrench[3] = weight, 0.0, 0.0, 0.0
        return
    exact = path.pieces > 0 and lag > 0.0
    _lean(b, path, t + (2.0 * lead if exact else lead + lag), heading, stencil)
    wrench[0] = stencil.thrust[2]
    _moments(b, stencil, path.yaw_rate, wrench)
    _lean(b, path, t, heading, stencil)
    if exact:
        for k in range(4):
            stencil.later[k] = wrench[k]
        wrench[0] = stencil.thrust[2]
        _moments(b, stencil, path.yaw_rate, wrench)
        for k in range(4):  # value and slope at t + lead, by what is asked for at t and at t + 2·lead
            slope = (stencil.later[k] - wrench[k]) / (2.0 * lead)
            wrench[k] = 0.5 * (stencil.later[k] + wrench[k])
            # Speeds lag, and thrust is their square: (w + lag·w')² = w² + lag·(w²)' + ((lag·(w²)')/(2 w))².
            if k == 0:
                wrench[0] += 0.25 * (lag * slope) ** 2 / wrench[0]
            wrench[k] += lag * slope
    for i in range(3):
        state[i] = stencil.vehicle[2, i]
        state[3 + i] = stencil.load[2, i]
        state[6 + i] = (stencil.vehicle[3, i] - stencil.vehicle[1, i]) / (2.0 * h)
        state[9 + i] = (stencil.load[3, i] - stencil.load[1, i]) / (2.0 * h)
    state[12], state[13], state[14] = _body_rates(stencil, path.yaw_rate)
    state[15], state[16] = stencil.attitude[2, 0], stencil.attitude[2, 1]
    state[17] = path.yaw + stencil.attitude[2, 2]
