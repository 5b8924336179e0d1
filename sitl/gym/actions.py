"""What an action means: thrust and body rates, or the rotors themselves. All components are -1 to 1."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from controller.law.allocation import allocation
from controller.law.attitude_law import attitude_law, attitude_step
from controller.law.control_law import WORK
from controller.law.state import BODY_RATES, STATE_SIZE
from sitl_bridge.ids import ACTUATOR_CONTROLS
from sitl_bridge.vehicle.description import Vehicle, hover_rotor_speeds
from sitl_bridge.vehicle.rotors import full_thrust

Array = NDArray[np.float64]
LARGEST_RATES = np.array([3.0, 3.0, 1.5])
"""rad/s, roll, pitch, yaw, of an action of 1."""


def _box(size: int) -> Box:
    return Box(-1.0, 1.0, (size,), np.float32)


class Actions(Protocol):
    """Turns actions into rotor controls."""

    space: Box

    def take(self, action: Array) -> None:
        """Take the action of this step."""

    def controls(self, body_rates: Array) -> Array:
        """Rotor controls (16,), 0 to 1, of the next tick, at measured body rates (3,), rad/s FLU."""


class RotorActions:
    """One component for each rotor: -1 stops it, 0 is hover, 1 is full speed."""

    def __init__(self, vehicle: Vehicle) -> None:
        speeds = np.array(hover_rotor_speeds(vehicle))
        self.space = _box(len(speeds))
        self._hover = speeds / np.array([rotor.max_speed for rotor in vehicle.rotors])
        self._controls = np.zeros(ACTUATOR_CONTROLS)

    def take(self, action: Array) -> None:
        """Take the action of this step."""
        room = np.where(action > 0.0, 1.0 - self._hover, self._hover)
        self._controls[: len(action)] = self._hover + action * room

    def controls(self, body_rates: Array) -> Array:
        """The same at each tick."""
        return self._controls


class RateActions:
    """Thrust (-1: none, 0: hover's, 1: all there is), then roll, pitch and yaw rates; a rate loop follows."""

    def __init__(self, vehicle: Vehicle, rate_hz: float) -> None:
        self.space = _box(4)
        self._hover, self._full = vehicle.hover_thrust, full_thrust(vehicle.rotors)
        self._law = attitude_law(vehicle, rate_hz)
        self._estimate = np.zeros(STATE_SIZE)
        self._controls = np.zeros(ACTUATOR_CONTROLS)
        self._step = attitude_step.bind(
            self._law, allocation(vehicle), np.zeros(1, dtype=WORK), self._estimate, self._controls
        )

    def take(self, action: Array) -> None:
        """Take the action of this step."""
        room = self._full - self._hover if action[0] > 0.0 else self._hover
        self._law["thrust"] = self._hover + float(action[0]) * room
        self._law["rate"] = action[1:] * LARGEST_RATES

    def controls(self, body_rates: Array) -> Array:
        """The rate loop's commands."""
        self._estimate[BODY_RATES] = body_rates
        self._step()
        return self._controls


def actions(kind: str, vehicle: Vehicle, rate_hz: float) -> Actions:
    """`rates` or `rotors`. Raises ValueError for anything else."""
    if kind == "rates":
        return RateActions(vehicle, rate_hz)
    if kind == "rotors":
        return RotorActions(vehicle)
    raise ValueError(f"actions = {kind!r}; expected rates or rotors")
