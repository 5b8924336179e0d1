"""White force on vehicle and load: drawn anew at fixed intervals and held in between."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.plant.dynamics import FORCE_ROWS
from sitl_bridge.vehicle import Disturbance

STREAM = "white force"


def random_stream(seed: int, name: str) -> np.random.Generator:
    """The generator of one source of randomness; another name is another, independent stream."""
    return np.random.default_rng([seed, *name.encode()])


class HeldForce:
    """A table of force draws, rows of (6,): on vehicle and load, N, world; row k acts `hold_steps` steps."""

    def __init__(self, disturbance: Disturbance, step: float, seed: int) -> None:
        self._std = np.zeros(6)
        if disturbance.acts_on != "load":
            self._std[:3] = disturbance.force_std
        if disturbance.acts_on != "vehicle":
            self._std[3:] = disturbance.force_std
        self.hold_steps = max(1, round(disturbance.hold_time / step))
        self.table: NDArray[np.float64] = np.zeros((FORCE_ROWS, 6))
        self.now: NDArray[np.float64] = np.zeros(6)
        """The force that acts now."""
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Begin again with a fresh stream."""
        self._generator = random_stream(seed, STREAM)
        self._next_step = 0
        self._draw()

    def position(self, steps: int) -> tuple[int, int]:
        """(number of the next step in the table, how many of `steps` it still covers)."""
        covered = FORCE_ROWS * self.hold_steps - self._next_step
        return self._next_step, min(steps, covered)

    def advance(self, steps: int) -> None:
        """So many steps were taken."""
        self._next_step += steps
        if self._next_step == FORCE_ROWS * self.hold_steps:
            self._next_step = 0
            self._draw()
        elif self._std.any():
            self.now[:] = self.table[self._next_step // self.hold_steps]

    def _draw(self) -> None:
        if self._std.any():
            self.table[:] = self._generator.standard_normal((FORCE_ROWS, 6)) * self._std
            self.now[:] = self.table[0]
