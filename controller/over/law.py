"""The integral LQR for a vehicle whose attitude loop belongs to somebody else.

Inputs are the collective thrust and the body rates. The stack's rate loop and link are a lag and a delay of
the model. The cost is minimised for the sampled loop, as in `design.lqr`. The reference is the same flat
motion.

u = u* - K·[x - x*; v] - sum of K_past·(u_past - u*_past), v the integral of the load's error. States: eq. 31,
then the deviation of the lagging thrust, N.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import linalg

from controller.design.lqr import SampledGain, Weights, sampled_gain, sampled_model
from controller.design.model import LinearModel, linear_model, with_integrator
from controller.law.flatness import STENCIL, body
from controller.law.reference import DERIVATIVES, Path, path_derivatives
from controller.law.state import (
    BODY_RATES,
    EULER_ANGLES,
    LOAD_POSITION,
    LOAD_VELOCITY,
    STATE_SIZE,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
    WRENCH_SIZE,
    Array,
)
from controller.over.motion import path_motion
from controller.over.stack import Stack
from sitl_bridge.vehicle.description import Vehicle

RATE_HZ = 100.0
"""Of the law, and of its set-points."""
THRUST = STATE_SIZE
"""Index of the lagging thrust in the model's state."""
LARGEST_RATE = 3.0
"""rad/s, of roll and pitch."""
LARGEST_YAW_RATE = 1.0
LARGEST_INTEGRAL = 2.0
"""m s, on each axis."""


def companion_model(vehicle: Vehicle, stack: Stack) -> LinearModel:
    """The model at hover from set-points on: 18 states of eq. 31 and the thrust's deviation; 4 inputs."""
    hover = linear_model(vehicle)
    a = np.zeros((STATE_SIZE + 1, STATE_SIZE + 1))
    b = np.zeros((STATE_SIZE + 1, WRENCH_SIZE))
    a[:STATE_SIZE, :STATE_SIZE] = hover.A
    a[:STATE_SIZE, THRUST] = hover.B[:, 0]
    for axis, rate in enumerate(range(BODY_RATES.start, BODY_RATES.stop)):
        a[rate, :] = 0.0
        a[rate, rate] = -1.0 / stack.rate_lag
        b[rate, 1 + axis] = 1.0 / stack.rate_lag
    a[THRUST, THRUST] = -1.0 / stack.thrust_lag
    b[THRUST, 0] = 1.0 / stack.thrust_lag
    return LinearModel(a, b)


def companion_weights(vehicle: Vehicle, accurate: bool = True) -> Weights:
    """By largest acceptable deviation (Bryson's rule).

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


def design(vehicle: Vehicle, stack: Stack, accurate: bool = True, rate_hz: float = RATE_HZ) -> Design:
    """Gains for a vehicle over a stack, at the law's rate; accurate: as in `companion_weights`."""
    period = 1.0 / rate_hz
    delay = max(0, round(stack.delay / period))
    model = with_integrator(companion_model(vehicle, stack), LOAD_POSITION)
    gain = sampled_gain(sampled_model(model, companion_weights(vehicle, accurate), period), delay)
    return Design(gain, period, delay, math.exp(-period / stack.thrust_lag))


class Setpoint(NamedTuple):
    """What the law wants of the stack."""

    thrust: float
    """N"""
    rates: tuple[float, float, float]
    """rad/s, body FLU"""


class Terms(NamedTuple):
    """What a step was made of, each (4,): thrust in N and body rates in rad/s."""

    feedforward: Array
    proportional: Array
    integral: Array


class CompanionLaw:
    """One engagement of the law: from a reference path and estimates to set-points."""

    def __init__(self, vehicle: Vehicle, stack: Stack, design: Design, path: Path) -> None:
        self._design = design
        self._path = path.copy()
        self._lead = design.delay * design.period + 0.5 * design.period
        self._thrust_lead = self._lead + stack.thrust_lag
        self._rate_lead = self._lead + stack.rate_lag
        self._heading = np.zeros(2)
        self._state, self._wrench = np.zeros(STATE_SIZE), np.zeros(WRENCH_SIZE)
        self._motion = path_motion.bind(
            np.array([body(vehicle)]),
            self._path,
            np.zeros(1, STENCIL),
            self._heading,
            self._state,
            self._wrench,
        )
        self._integral = np.zeros(3)
        self._thrust = 0.0  # deviation of the lagging thrust from u*, N
        self._past = np.zeros((max(1, design.delay), WRENCH_SIZE))
        self._full = math.inf
        self.reference = np.zeros(3)
        """m, where the load is to be now."""
        self.terms: Terms | None = None
        self._hover = (vehicle.airframe.mass + vehicle.load.mass) * vehicle.gravity

    def step(self, estimate: Array, time_s: float) -> Setpoint:
        """Set-points for an estimate (18,), eq. 31, at `time_s` since the law was engaged."""
        gain, period = self._design.gain, self._design.period
        desired, feedforward = self._feedforward(time_s)
        self.reference = desired[LOAD_POSITION].copy()
        yaw = float(self.path["yaw"][0])
        deviation = _in_heading(estimate - desired, yaw)
        error = estimate[LOAD_POSITION] - self.reference
        self._integral = np.clip(self._integral + period * error, -LARGEST_INTEGRAL, LARGEST_INTEGRAL)
        state = gain.state
        proportional = -(state[:, :STATE_SIZE] @ deviation + state[:, THRUST] * self._thrust)
        for age in range(self._design.delay):
            proportional -= gain.past[age] @ self._past[age]
        integral = -state[:, THRUST + 1 :] @ _turned(self._integral, yaw)
        wanted = feedforward + proportional + integral
        given = self._limited(wanted)
        self._remember(given - feedforward)
        self.terms = Terms(feedforward, proportional, integral)
        return Setpoint(float(given[0]), (float(given[1]), float(given[2]), float(given[3])))

    @property
    def path(self) -> Path:
        """The reference's path (1,); its owner may write to it."""
        return self._path

    @path.setter
    def path(self, path: Path) -> None:
        self._path[:] = path

    def desired(self, time_s: float, lead: float = 0.0) -> Array:
        """x* (18,): the state that belongs to the path at a time; the wrench is that of `lead` s later."""
        yaw = float(self._path["yaw"][0])
        self._heading[:] = math.cos(yaw), math.sin(yaw)
        self._motion(time_s, lead)
        return self._state.copy()

    def raw(self, time_s: float) -> Array:
        """(3,), m: where the load is to be at a time, as it is set, without a smooth start."""
        derivatives = np.zeros((DERIVATIVES + 1, 3))
        path_derivatives(self._path.view(np.recarray)[0], time_s, derivatives)
        position: Array = derivatives[0]
        return position

    def _feedforward(self, time_s: float) -> tuple[Array, Array]:
        """x* (18,) now, and u* (4,): the thrust and the rates that are needed once they act."""
        rates = self.desired(time_s + self._rate_lead)[BODY_RATES]
        desired = self.desired(time_s, self._thrust_lead)
        return desired, np.concatenate((self._wrench[:1], rates))

    def _limited(self, wanted: Array) -> Array:
        """Within what a stack is asked for at most."""
        least, most = 0.2 * self._hover, 2.5 * self._hover
        given = wanted.copy()
        given[0] = min(most, max(least, wanted[0]))
        given[1:3] = np.clip(wanted[1:3], -LARGEST_RATE, LARGEST_RATE)
        given[3] = min(LARGEST_YAW_RATE, max(-LARGEST_YAW_RATE, wanted[3]))
        return given

    def _remember(self, deviation: Array) -> None:
        """What is under way, and what the lagging thrust becomes."""
        delay = self._design.delay
        acting = self._past[delay - 1, 0] if delay else deviation[0]
        decay = self._design.thrust_decay
        self._thrust = decay * self._thrust + (1.0 - decay) * float(acting)
        self._past[1:] = self._past[:-1].copy()
        self._past[0] = deviation


def _turned(vector: Array, yaw: float) -> Array:
    """A world vector (3,) in the heading's frame."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.array([cosine * vector[0] + sine * vector[1], cosine * vector[1] - sine * vector[0], vector[2]])


def _in_heading(deviation: Array, yaw: float) -> Array:
    """x - x* (18,) with positions and velocities in the heading's frame, the yaw wrapped to -pi..pi."""
    out = deviation.copy()
    for part in (VEHICLE_POSITION, LOAD_POSITION, VEHICLE_VELOCITY, LOAD_VELOCITY):
        out[part] = _turned(deviation[part], yaw)
    out[STATE_SIZE - 1] = math.remainder(float(out[STATE_SIZE - 1]), 2.0 * math.pi)
    return out


def stable(vehicle: Vehicle, stack: Stack, accurate: bool = True, rate_hz: float = RATE_HZ) -> float:
    """Spectral radius of the closed sampled loop, delay included: below 1 it is stable."""
    found = design(vehicle, stack, accurate, rate_hz)
    model = with_integrator(companion_model(vehicle, stack), LOAD_POSITION)
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
