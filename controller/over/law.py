"""The integral LQR for a vehicle whose attitude loop belongs to somebody else.

Inputs are the collective thrust, and body rates or an attitude; `model` has the loop and its gains. The
reference is the same flat motion.

u = u* - K·[x - x*; v] - sum of K_past·(u_past - u*_past), v the integral of the load's error.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

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
from controller.over.model import THRUST, YAW, Design
from controller.over.motion import path_motion
from controller.over.stack import Stack
from sitl_bridge.frames import Triple
from sitl_bridge.vehicle.description import Vehicle

LARGEST_RATE = 3.0
"""rad/s, of roll and pitch."""
LARGEST_YAW_RATE = 1.0
LARGEST_LEAN = math.radians(45.0)
"""Of roll and of pitch, where an attitude is asked for."""
LARGEST_INTEGRAL = 2.0
"""m s, on each axis."""


class Setpoint(NamedTuple):
    """What the law wants of the stack."""

    thrust: float
    """N"""
    rates: Triple
    """rad/s, body FLU; beside an attitude, those that belong to the reference."""
    attitude: Triple | None = None
    """Roll, pitch, yaw, rad, FLU to ENU; None: the rates are what is wanted."""


class Terms(NamedTuple):
    """What a step was made of, each (4,): thrust in N, and body rates (rad/s) or roll, pitch, yaw (rad)."""

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
        self._rates = np.zeros(3)
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
        thrust, *turn = given.tolist()
        if self._design.attitude is None:
            return Setpoint(thrust, _triple(turn))
        return Setpoint(thrust, _triple(self._rates.tolist()), _triple(turn))

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
        """x* (18,) now, and u* (4,): the thrust, and the rates or attitude, that are needed once they act."""
        self._rates = turn = self.desired(time_s + self._rate_lead)[BODY_RATES]
        gains = self._design.attitude
        if gains is not None:  # an attitude loop turns by its error: what is asked for is ahead by that much
            turn = self.desired(time_s + self._lead)[EULER_ANGLES]
            turn += self._rates / (gains.tilt, gains.tilt, gains.yaw)
        desired = self.desired(time_s, self._thrust_lead)
        return desired, np.concatenate((self._wrench[:1], turn))

    def _limited(self, wanted: Array) -> Array:
        """Within what a stack is asked for at most."""
        least, most = 0.2 * self._hover, 2.5 * self._hover
        given = wanted.copy()
        given[0] = min(most, max(least, wanted[0]))
        if self._design.attitude is not None:
            given[1:3] = np.clip(wanted[1:3], -LARGEST_LEAN, LARGEST_LEAN)
            return given
        given[1:3] = np.clip(wanted[1:3], -LARGEST_RATE, LARGEST_RATE)
        given[1 + YAW] = min(LARGEST_YAW_RATE, max(-LARGEST_YAW_RATE, wanted[1 + YAW]))
        return given

    def _remember(self, deviation: Array) -> None:
        """What is under way, and what the lagging thrust becomes."""
        delay = self._design.delay
        acting = self._past[delay - 1, 0] if delay else deviation[0]
        decay = self._design.thrust_decay
        self._thrust = decay * self._thrust + (1.0 - decay) * float(acting)
        self._past[1:] = self._past[:-1].copy()
        self._past[0] = deviation


def _triple(values: list[float]) -> Triple:
    x, y, z = values
    return (x, y, z)


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
