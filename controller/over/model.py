"""The companion's model of vehicle, load and stack, and the gains that are designed on it.

Inputs are the collective thrust and body rates, or the thrust and an attitude. The stack's loops and link are
lags and a delay of the model. The cost is minimised for the sampled loop, as in `design.lqr`. States: eq. 31,
then the deviation of the lagging thrust, N.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from scipy import linalg

from controller.design.lqr import SampledGain, Weights, sampled_gain, sampled_model
from controller.design.model import LinearModel, linear_model, with_integrator
from controller.law.state import (
    BODY_RATES,
    EULER_ANGLES,
    LOAD_POSITION,
    LOAD_VELOCITY,
    STATE_SIZE,
    VEHICLE_VELOCITY,
    WRENCH_SIZE,
)
from controller.over.stack import AttitudeGains, Stack
from sitl_bridge.vehicle.description import Vehicle

RATE_HZ = 100.0
"""Of the law, and of its set-points."""
THRUST = STATE_SIZE
"""Index of the lagging thrust in the model's state."""
YAW = 2
"""Index of the axis."""


class Steering(StrEnum):
    """What the stack is given besides the thrust."""

    RATES = "rates"
    """Body rates: its rate loop flies."""
    ATTITUDE = "attitude"
    """An attitude: its attitude loop flies, above the rate loop."""


def companion_model(vehicle: Vehicle, stack: Stack, attitude: AttitudeGains | None = None) -> LinearModel:
    """The model at hover from set-points on: 18 states of eq. 31 and the thrust's deviation; 4 inputs.

    attitude: gains of the stack's attitude loop, where the last three inputs are roll, pitch and yaw (rad);
    None: they are body rates (rad/s).
    """
    hover = linear_model(vehicle)
    a = np.zeros((STATE_SIZE + 1, STATE_SIZE + 1))
    b = np.zeros((STATE_SIZE + 1, WRENCH_SIZE))
    a[:STATE_SIZE, :STATE_SIZE] = hover.A
    a[:STATE_SIZE, THRUST] = hover.B[:, 0]
    for axis, rate in enumerate(range(BODY_RATES.start, BODY_RATES.stop)):
        a[rate, :] = 0.0
        a[rate, rate] = -1.0 / stack.rate_lag
        b[rate, 1 + axis] = 1.0 / stack.rate_lag
        if attitude is not None:  # rates are asked for by the error of the angle
            gain = attitude.yaw if axis == YAW else attitude.tilt
            b[rate, 1 + axis] *= gain
            a[rate, EULER_ANGLES.start + axis] = -gain / stack.rate_lag
    a[THRUST, THRUST] = -1.0 / stack.thrust_lag
    b[THRUST, 0] = 1.0 / stack.thrust_lag
    return LinearModel(a, b)


def companion_weights(
    vehicle: Vehicle, accurate: bool = True, attitude: AttitudeGains | None = None
) -> Weights:
    """By largest acceptable deviation (Bryson's rule); attitude: as in `companion_model`.

    accurate: the state is known to centimetres. Otherwise the load's place counts less: a tight loop would
    turn the decimetres by which a stack's position wanders into swing.
    """
    deviations = np.full(STATE_SIZE + 1 + 3, math.inf)
    deviations[LOAD_POSITION] = 0.5 if accurate else 1.0  # m
    deviations[VEHICLE_VELOCITY] = deviations[LOAD_VELOCITY] = 0.6  # m/s
    deviations[BODY_RATES] = 2.0  # rad/s
    deviations[EULER_ANGLES] = (0.5, 0.5, 0.4)  # rad
    deviations[STATE_SIZE + 1 :] = 0.8 if accurate else 2.0  # m s
    mass = vehicle.airframe.mass + vehicle.load.mass
    efforts = np.array([mass * 2.0, 1.2, 1.2, 0.6])  # N, rad/s
    if attitude is not None:  # the angles by which those rates are asked for
        efforts[1:] /= (attitude.tilt, attitude.tilt, attitude.yaw)
    on_states = np.where(np.isinf(deviations), 1e-6, deviations**-2.0)
    return Weights(np.diag(on_states), np.diag(efforts**-2.0))


class Design(NamedTuple):
    """Gains of the sampled and delayed loop."""

    gain: SampledGain
    period: float
    """s"""
    delay: int
    """Periods."""
    thrust_decay: float
    """Share of the thrust's lag that is left after a period."""
    attitude: AttitudeGains | None
    """As in `companion_model`."""


def design(
    vehicle: Vehicle,
    stack: Stack,
    accurate: bool = True,
    attitude: AttitudeGains | None = None,
    rate_hz: float = RATE_HZ,
) -> Design:
    """Gains for a vehicle over a stack, at the law's rate; accurate: as in `companion_weights`, attitude: as
    in `companion_model`.
    """
    period = 1.0 / rate_hz
    delay = max(0, round(stack.delay / period))
    model = with_integrator(companion_model(vehicle, stack, attitude), LOAD_POSITION)
    weights = companion_weights(vehicle, accurate, attitude)
    gain = sampled_gain(sampled_model(model, weights, period), delay)
    return Design(gain, period, delay, math.exp(-period / stack.thrust_lag), attitude)


def stable(
    vehicle: Vehicle, stack: Stack, accurate: bool = True, attitude: AttitudeGains | None = None
) -> float:
    """Spectral radius of the closed sampled loop, delay included: below 1 it is stable."""
    found = design(vehicle, stack, accurate, attitude)
    model = with_integrator(companion_model(vehicle, stack, attitude), LOAD_POSITION)
    n, m = model.B.shape
    transition = linalg.expm(np.block([[model.A, model.B], [np.zeros((m, n + m))]]) * found.period)
    a, b = transition[:n, :n], transition[:n, n:]
    delay = found.delay
    size = n + delay * m
    loop = np.zeros((size, size))
    feedback = np.hstack([-found.gain.state, *(-found.gain.past[age] for age in range(delay))])
    loop[:n, :n] = a
    if delay:
        loop[:n, n + (delay - 1) * m :] = b
        loop[n : n + m] = feedback
        loop[n + m :, n:-m] = np.eye((delay - 1) * m)
    else:
        loop[:n] += b @ feedback
    return float(np.max(np.abs(linalg.eigvals(loop))))
