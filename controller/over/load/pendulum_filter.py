"""Where the load is, from the vehicle's state: an extended Kalman filter on the elastic pendulum.

State: position (m) and velocity (m/s) of the load in the world, and a lateral bias of the accelerometer
(m/s²), which stands for the wind on the vehicle, too. The vehicle's motion is an input. The accelerometer
feels the sideways pull of the cable, and so how the load swings, whatever the thrust: rotors pull along the
body's z axis only. A position of the load is taken in where there is one.
"""

from __future__ import annotations

import math

import numpy as np

from controller.law.state import Array
from sitl_bridge.frames import Quaternion, Triple, rotate, rotate_inverse
from sitl_bridge.vehicle.description import Vehicle

LONGEST_STEP = 0.004
"""s, of the integration of the bouncing cable."""
FORCE_NOISE = 0.4
"""m/s²/sqrt(Hz): what else pushes the load."""
BIAS_NOISE = 0.05
"""m/s²/sqrt(s)"""
ACCELEROMETER_NOISE = 0.35
"""m/s², of one sample, vibration included."""
FIRST_DEVIATIONS = (0.3, 0.3, 0.1, 0.4, 0.4, 0.2, 0.3, 0.3)
SIZE = 8


class PendulumFilter:
    """The load below one vehicle, from hover on."""

    def __init__(self, vehicle: Vehicle, position: Triple, velocity: Triple) -> None:
        """position, velocity: of the vehicle, m and m/s, world; the load is taken to hang below it."""
        self._vehicle = vehicle
        self.state: Array = np.zeros(SIZE)
        """(8,): position and velocity of the load, bias x and y of the body."""
        self.state[0:3] = (position[0], position[1], position[2] - vehicle.hover_length)
        self.state[3:6] = velocity
        self.covariance: Array = np.diag(np.square(FIRST_DEVIATIONS))

    def predict(self, position: Triple, velocity: Triple, duration: float) -> None:
        """Go on by `duration` s, the vehicle being at `position` (m) with `velocity` (m/s) at its end."""
        steps = max(1, math.ceil(duration / LONGEST_STEP))
        dt = duration / steps
        for k in range(steps):
            before = duration - (k + 1) * dt
            at = tuple(p - v * before for p, v in zip(position, velocity, strict=True))
            self._step(np.array(at), np.array(velocity), dt)

    def _step(self, at: Array, velocity: Array, dt: float) -> None:
        """Semi-implicit Euler, and the covariance with its Jacobian."""
        pull, stiffness, damping = self._pull(at, velocity)
        mass = self._vehicle.load.mass
        acceleration = pull / mass - np.array((0.0, 0.0, self._vehicle.gravity))
        transition = np.eye(SIZE)
        transition[3:6, 0:3] = dt * stiffness / mass
        transition[3:6, 3:6] += dt * damping / mass
        transition[0:3, 0:6] += dt * transition[3:6, 0:6]
        self.state[3:6] += dt * acceleration
        self.state[0:3] += dt * self.state[3:6]
        noise = np.zeros(SIZE)
        noise[3:6] = FORCE_NOISE**2 * dt
        noise[6:8] = BIAS_NOISE**2 * dt
        self.covariance = transition @ self.covariance @ transition.T + np.diag(noise)

    def _pull(self, at: Array, velocity: Array) -> tuple[Array, Array, Array]:
        """Cable force on the load (3,), N, and its derivatives (3, 3) by the load's position and velocity."""
        cable = self._vehicle.cable
        away = self.state[0:3] - at
        length = max(1e-6, float(np.linalg.norm(away)))
        unit = away / length
        rate = float(unit @ (self.state[3:6] - velocity))
        tension = cable.stiffness * (length - cable.rest_length) + cable.damping * rate
        along = np.outer(unit, unit)
        if tension <= 0.0 and cable.model == "tension-only":
            return np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3))
        across = np.eye(3) - along
        stiffness = -(cable.stiffness * along + tension / length * across)
        return -tension * unit, stiffness, -cable.damping * along

    def feel(self, attitude: Quaternion, at: Triple, velocity: Triple, specific_force: Triple) -> None:
        """Take in the accelerometer (m/s², FLU): its x and y feel the cable's pull and the air's drag."""
        mass = self._vehicle.airframe.mass
        pull, stiffness, _ = self._pull(np.array(at), np.array(velocity))
        x, y, z = (-pull / mass).tolist()
        felt = rotate_inverse(attitude, (x, y, z))
        drag = self._drag(attitude, velocity)
        rotation = np.array([rotate(attitude, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))])
        rows = np.zeros((2, SIZE))
        rows[:, 0:3] = -(rotation @ stiffness) / mass
        rows[:, 6:8] = np.eye(2)
        expected = np.array((felt[0] + drag[0], felt[1] + drag[1])) + self.state[6:8]
        residual = np.array(specific_force[:2]) - expected
        self._update(rows, residual, np.full(2, ACCELEROMETER_NOISE**2))

    def _drag(self, attitude: Quaternion, velocity: Triple) -> Triple:
        """Specific force of still air on the vehicle, m/s², FLU."""
        drag, mass = self._vehicle.airframe.drag, self._vehicle.airframe.mass
        factor = -(drag.linear + drag.quadratic * math.hypot(*velocity)) / mass
        east, north, up = velocity
        return rotate_inverse(attitude, (factor * east, factor * north, factor * up))

    def see(self, position: Triple, deviation: float, velocity: Triple | None = None) -> None:
        """Take in a position of the load (m, world) and its velocity (m/s); deviation: standard, of both."""
        rows = np.zeros((3, SIZE))
        rows[:, 0:3] = np.eye(3)
        self._update(rows, np.array(position) - self.state[0:3], np.full(3, deviation**2))
        if velocity is not None:
            rows = np.zeros((3, SIZE))
            rows[:, 3:6] = np.eye(3)
            self._update(rows, np.array(velocity) - self.state[3:6], np.full(3, deviation**2))

    def _update(self, rows: Array, residual: Array, variances: Array) -> None:
        """Scalar updates one after the other, in Joseph's form."""
        moved = np.zeros(SIZE)
        for row, value, variance in zip(rows, residual.tolist(), variances.tolist(), strict=True):
            projected = self.covariance @ row
            gain = projected / (float(row @ projected) + variance)
            moved += gain * (value - float(row @ moved))
            left = np.eye(SIZE) - np.outer(gain, row)
            self.covariance = left @ self.covariance @ left.T + variance * np.outer(gain, gain)
        self.state = self.state + moved
