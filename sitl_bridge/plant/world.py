"""The physical world: vehicle, cable and load, advanced in fixed steps under held rotor commands. No I/O."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.plant.disturbance import HeldForce
from sitl_bridge.plant.dynamics import advance
from sitl_bridge.plant.parameters import MOST_ROTORS, parameters
from sitl_bridge.plant.sensing import MEASUREMENT, measure
from sitl_bridge.plant.state import STATE_SIZE, Array, initial_state
from sitl_bridge.vehicle import Vehicle

LARGEST_STEP = 1e-3
"""Longest integration step, s."""


class World:
    """State and what acts on it. `state` is the vector of `plant.state`, world ENU, SI units."""

    def __init__(self, vehicle: Vehicle, rate_hz: float, seed: int) -> None:
        self.vehicle = vehicle
        self.steps_per_tick = max(1, math.ceil(1.0 / (rate_hz * LARGEST_STEP) - 1e-9))
        self.step = 1.0 / (rate_hz * self.steps_per_tick)
        self.state = initial_state(vehicle)
        self.rotor_speed = np.zeros(MOST_ROTORS)
        self.trim_controls = trim_controls(vehicle)
        self._seed = seed
        self._record = parameters(vehicle)
        self._largest_speed = self._record["max_speed"][0]
        self.measurement = np.zeros(1, dtype=MEASUREMENT)
        self._force = HeldForce(vehicle.disturbance, self.step, seed)
        self._advance = advance.bind(
            self._record, self.state, self.rotor_speed, self._force.table, np.zeros((5, STATE_SIZE))
        )
        self._measure = measure.bind(
            self._record,
            self.state,
            self.rotor_speed,
            self._force.now,
            np.zeros(STATE_SIZE),
            self.measurement,
        )
        self.reset()

    def reset(self) -> None:
        """Back to the initial state, with fresh random streams and the rotors as in hover."""
        self.state[:] = initial_state(self.vehicle)
        self._force.reset(self._seed)
        self.command(self.trim_controls)

    def command(self, controls: Sequence[float]) -> None:
        """Set the rotors: 16 controls of 0..1, proportional to speed; what is not finite means stopped."""
        for i, (control, largest) in enumerate(zip(controls, self._largest_speed.tolist(), strict=True)):
            within = min(max(control, 0.0), 1.0) if math.isfinite(control) else 0.0
            self.rotor_speed[i] = within * largest

    def advance(self, steps: int) -> None:
        """Advance by so many integration steps with the rotors held."""
        while steps > 0:
            first, rows_left = self._force.position(steps)
            self._advance(first, self._force.hold_steps, rows_left, self.step)
            self._force.advance(rows_left)
            steps -= rows_left

    def log_sources(self) -> tuple[NDArray[Any], Array, Array, Array]:
        """Parameter record, state, rotor speeds and force as they change, for a log to read."""
        return self._record, self.state, self.rotor_speed, self._force.now

    def measure(self, held: bool, home_altitude: float) -> None:
        """Fill `measurement` from the world as it is; a held vehicle measures as if it stood."""
        self._measure(held, home_altitude)


def trim_controls(vehicle: Vehicle) -> tuple[float, ...]:
    """Controls (16) whose thrust carries vehicle and load without any moment."""
    effect = np.array(
        [
            (
                rotor.thrust_coefficient,
                rotor.position[1] * rotor.thrust_coefficient,
                -rotor.position[0] * rotor.thrust_coefficient,
                (-1.0 if rotor.direction == "ccw" else 1.0) * rotor.torque_coefficient,
            )
            for rotor in vehicle.rotors
        ]
    ).T
    squared, *_ = np.linalg.lstsq(effect, np.array([vehicle.hover_thrust, 0.0, 0.0, 0.0]), rcond=None)
    speeds = np.sqrt(np.maximum(squared, 0.0))
    largest = np.array([rotor.max_speed for rotor in vehicle.rotors])
    controls = np.minimum(speeds / largest, 1.0).tolist()
    return (*controls, *([0.0] * (MOST_ROTORS - len(controls))))
