"""White force on vehicle and load: drawn anew at fixed intervals and held in between."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.plant.physics.air import WIND_HOLD, Wind
from sitl_bridge.plant.physics.dynamics import TABLE_ROWS
from sitl_bridge.plant.random_streams import stream
from sitl_bridge.vehicle.description import Disturbance, Vehicle

STREAM = "white force"

HELD = np.dtype([("table", "f8", (TABLE_ROWS, 6)), ("now", "f8", 6)])
"""A table of draws, rows of (6,) for vehicle and load, world, and the row that acts now."""


class HeldTable(ABC):
    """Draws that are held: row k of the table acts `hold_steps` steps."""

    def __init__(self, hold_time: float, step: float, record: np.void) -> None:
        """record: of HELD, written."""
        self.hold_steps = max(1, round(hold_time / step))
        self.hold = self.hold_steps * step
        """What a row really holds, s: a whole number of steps."""
        self.table: NDArray[np.float64] = record["table"]
        self.now: NDArray[np.float64] = record["now"]
        """The row that acts now."""
        self.next_step = 0
        """Number of the next step, counted from row 0."""
        self.steps_left = 0
        """How many steps the table still covers."""
        self.constant = True
        """Whether nothing ever changes: row 0 acts for good, and there is no need to count."""

    def begin(self) -> None:
        """Start from a fresh table."""
        self.next_step = 0
        self.steps_left = TABLE_ROWS * self.hold_steps
        self.draw()
        self.now[:] = self.table[0]

    def advance(self, steps: int) -> None:
        """So many steps were taken, at most as many as were left."""
        if self.constant:
            return
        self.count(steps)
        if self.steps_left == 0:
            self.begin()
        else:
            self.now[:] = self.table[self.next_step // self.hold_steps]

    def count(self, steps: int) -> None:
        """So many steps were taken, fewer than were left, and `now` is right already."""
        self.next_step += steps
        self.steps_left -= steps

    @abstractmethod
    def draw(self) -> None:
        """Fill the whole table."""


class HeldForce(HeldTable):
    """White force, N."""

    def __init__(self, disturbance: Disturbance, step: float, seed: int, record: np.void) -> None:
        super().__init__(disturbance.hold_time, step, record)
        self._std = np.zeros(6)
        if disturbance.acts_on != "load":
            self._std[:3] = disturbance.force_std
        if disturbance.acts_on != "vehicle":
            self._std[3:] = disturbance.force_std
        self.constant = not self._std.any()
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Begin again with a fresh stream."""
        self._generator = stream(seed, STREAM)
        self.begin()

    def draw(self) -> None:
        """Fresh draws."""
        if not self.constant:
            self._generator.standard_normal(out=self.table)
            self.table *= self._std


class HeldWind(HeldTable):
    """Air velocity at vehicle and load, m/s."""

    def __init__(self, vehicle: Vehicle, step: float, seed: int, record: np.void) -> None:
        super().__init__(WIND_HOLD, step, record)
        self._vehicle = vehicle
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Begin again with a fresh stream."""
        self.wind = Wind(self._vehicle, seed, self.hold)
        self.constant = self.wind.constant
        self.begin()

    def draw(self) -> None:
        """What blows next."""
        self.wind.fill(self.table)
