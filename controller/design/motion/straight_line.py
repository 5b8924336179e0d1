"""What a motion of the load along a straight line asks of vehicle and cable, and how that changes with it.

The load's place on the line is a scalar s(t). Cable, vehicle, thrust and attitude follow from its first four
derivatives (`law.flatness`), the cable's length from its tension so far, the rotors' moments from the second
derivative of the attitude. All of it stays in the vertical plane of the line: the vehicle turns about the one
level axis across it.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from controller.design.motion.cable_length import lagging
from controller.design.motion.limits import Limits
from controller.law.state import Array
from sitl_bridge.vehicle.description import Drag, Vehicle
from sitl_bridge.vehicle.rotors import rotor_effect

ORDERS = 4
"""Derivatives of s that count; s itself does not."""
_AHEAD = 1e-3
"""s, over which the cable's direction is differentiated."""
_SMALL = 1e-5
_THRUST, _LEAN, _OVER_TILT = range(3)


class StraightLine:
    """Motions along a way (3,), m. Bounded are tilt, slackness, and each rotor's thrust."""

    def __init__(self, vehicle: Vehicle, way: Array, limits: Limits) -> None:
        self.distance = float(np.linalg.norm(way))
        """m"""
        self.gravity = vehicle.gravity
        self._vehicle = vehicle
        self._direction = way / self.distance
        self._limits = limits
        level = float(np.hypot(*way[:2]))
        self._level = np.array([way[0], way[1], 0.0]) / level if level > 0.0 else np.zeros(3)
        """The line's direction on the level"""
        about_x, about_y, _ = vehicle.airframe.inertia
        self._inertia = np.array([-about_x * self._level[1], about_y * self._level[0]])
        """Moments about body x and y for an angular acceleration of the lean"""
        self._share = np.linalg.pinv(rotor_effect(vehicle.rotors))
        """Thrust of each rotor for a wrench, over what it gives at full speed"""
        self._share /= np.array([[r.thrust_coefficient * r.max_speed**2] for r in vehicle.rotors])
        rotors = len(vehicle.rotors)
        self._bounds = np.array([0.0, 0.0, *[limits.most_thrust] * rotors, *[-limits.least_thrust] * rotors])[
            :, None
        ]
        self._rotor_lag = sum(rotor.time_constant for rotor in vehicle.rotors) / rotors
        self._cable_lag = vehicle.cable.damping / vehicle.cable.stiffness

    def excess(self, shares: Array, duration: float) -> Array:
        """By how much each limit is exceeded (rows, n), negative within it; scaled to about 1.

        shares: (5, n), of the way, and its derivatives by the share of the duration (s), evenly spaced.
        """
        motion = self._motion(shares, duration)
        spacing = duration / (shares.shape[1] - 1)
        asked = self._asked(motion, self._stretching(motion, spacing))
        return np.asarray(self._rows(asked[:, :, None], spacing)[:, :, 0] - self._bounds)

    def linearised(self, shares: Array, columns: Array, duration: float) -> tuple[Array, Array, Array]:
        """The excess (rows, n), its change (rows, n, m) with m coefficients, and with the duration (rows, n).

        columns: (5, n, m), by which the shares change with the coefficients.
        """
        spacing = duration / (shares.shape[1] - 1)
        motion = self._motion(shares, duration)
        moving = [self._motion(columns[:, :, k], duration) for k in range(columns.shape[2])]
        changes = np.stack(moving, axis=2)
        stretching = self._stretching(motion, spacing)
        asked = self._asked(motion, stretching)
        slopes = np.zeros((len(asked), *changes.shape[1:]))
        for order in range(ORDERS):
            moved, small = _moved(motion, order)
            slopes += ((self._asked(moved, stretching) - asked) / small)[:, :, None] * changes[order]
        to_length = self._length_matrix(len(asked[0]), spacing)
        steady = self._steady_length(motion)
        length_change = np.zeros(changes.shape[1:])
        for order in range(2):
            moved, small = _moved(motion, order)
            length_change += ((self._steady_length(moved) - steady) / small)[:, None] * changes[order]
        for order in range(3):
            moved, small = _moved(stretching, order)
            slope = (self._asked(motion, moved) - asked) / small
            slopes += slope[:, :, None] * (to_length[order] @ length_change)
        excess = self.excess(shares, duration)
        longer = self.excess(shares, duration * (1.0 + _SMALL))
        return excess, self._rows(slopes, spacing), (longer - excess) / (_SMALL * duration)

    def _motion(self, shares: Array, duration: float) -> Array:
        """Derivatives (4, n) of the load's way, m, s, from those of its share (5, n)."""
        powers = duration ** -np.arange(1.0, ORDERS + 1.0)
        return np.asarray(self.distance * powers[:, None] * shares[1:])

    def _steady_length(self, motion: Array) -> Array:
        """Length (n,), m, that the cable would have at rest under its tension now."""
        cable = self._vehicle.cable
        tension = np.linalg.norm(self._pull(motion[0], motion[1]), axis=1)
        return np.asarray(cable.rest_length + tension / cable.stiffness)

    def _length_matrix(self, n: int, spacing: float) -> Array:
        """Length and its two derivatives by the steady length less that of hover: (3, n, n)."""
        lagged = lagging(np.eye(n), spacing, self._cable_lag)
        once, twice = _differences(n)
        return np.stack([lagged, once @ lagged / spacing, twice @ lagged / spacing**2])

    def _stretching(self, motion: Array, spacing: float) -> Array:
        """Length of the cable, m, and its two derivatives (3, n)."""
        length = lagging(self._steady_length(motion), spacing, self._cable_lag)
        once, twice = _differences(len(length))
        return np.stack([length, once @ length / spacing, twice @ length / spacing**2])

    def _asked(self, motion: Array, stretching: Array) -> Array:
        """Thrust, N, lean, rad, excess of tilt and slackness (4, n) for derivatives of s (4, n)."""
        vehicle, limits = self._vehicle, self._limits
        speed, acceleration, jerk, snap = motion
        length, lengthening, length_acceleration = stretching[:, :, None]
        h = _AHEAD
        pull = self._pull(speed, acceleration)
        here = _unit(pull)
        ahead, behind = (
            _unit(
                self._pull(
                    speed + sign * h * acceleration + 0.5 * h * h * jerk,
                    acceleration + sign * h * jerk + 0.5 * h * h * snap,
                )
            )
            for sign in (1.0, -1.0)
        )
        turning, turning_faster = (ahead - behind) / (2.0 * h), (ahead - 2.0 * here + behind) / (h * h)
        velocity = speed[:, None] * self._direction + lengthening * here + length * turning
        own = acceleration[:, None] * self._direction
        own = own + length_acceleration * here + 2.0 * lengthening * turning + length * turning_faster
        force = vehicle.airframe.mass * own + pull + drag_force(vehicle.airframe.drag, velocity)
        force[:, 2] += vehicle.airframe.mass * vehicle.gravity
        sideways = force @ self._level
        return np.stack(
            [
                np.hypot(sideways, force[:, 2]),
                np.arctan2(sideways, force[:, 2]),
                (np.abs(sideways) - np.tan(limits.tilt) * force[:, 2]) / vehicle.hover_thrust,
                limits.tension - pull[:, 2] / (vehicle.load.mass * vehicle.gravity),
            ]
        )

    def _pull(self, speed: Array, acceleration: Array) -> Array:
        """The cable's pull on the load (n, 3), N."""
        load = self._vehicle.load
        pull = load.mass * acceleration[:, None] * self._direction
        pull += drag_force(load.drag, speed[:, None] * self._direction)
        pull[:, 2] += load.mass * self.gravity
        return np.asarray(pull)

    def _rows(self, asked: Array, spacing: float) -> Array:
        """What is bounded (rows, n, m), for what is asked (4, n, m): it is linear in it."""
        differences, second = _differences(asked.shape[1])
        wrench = np.zeros((4, *asked.shape[1:]))
        wrench[0] = asked[_THRUST]
        wrench[1:3] = self._inertia[:, None, None] / spacing**2 * (second @ asked[_LEAN])
        if self._rotor_lag > 0.0:  # lagging rotors are asked for more, ahead of time
            wrench += self._rotor_lag / spacing * (differences @ wrench)
        share = np.tensordot(self._share, wrench, axes=1)
        return np.concatenate([asked[_OVER_TILT:], share, -share])


def drag_force(drag: Drag, velocity: Array) -> Array:
    """Force (n, 3), N, against the drag of a body at velocities (n, 3), m/s, in still air."""
    speed = np.linalg.norm(velocity, axis=1)
    return np.asarray((drag.linear + drag.quadratic * speed)[:, None] * velocity)


def _moved(values: Array, order: int) -> tuple[Array, float]:
    """The values, one row of them a little larger, and by how much."""
    small = _SMALL * max(1.0, float(np.abs(values[order]).max()))
    moved = values.copy()
    moved[order] += small
    return moved, small


def _unit(vectors: Array) -> Array:
    """Vectors (n, 3) of length 1."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-9)[:, None])


@lru_cache(maxsize=4)
def _differences(n: int) -> tuple[Array, Array]:
    """Central differences (n, n) of evenly spaced values, times the spacing, and second ones.

    In front of the first value and behind the last one nothing changes.
    """
    once = 0.5 * (np.eye(n, k=1) - np.eye(n, k=-1))
    twice = np.eye(n, k=1) - 2.0 * np.eye(n) + np.eye(n, k=-1)
    once[0, 0], once[-1, -1] = -0.5, 0.5
    twice[0, 0] = twice[-1, -1] = -1.0
    return once, twice
