"""How old things are: by the wall clock, and by a simulated world's where there is one.

A simulated world may stand still for a while, as on a busy machine. Nothing ages then.
"""

from __future__ import annotations

import math
from collections.abc import Callable

LONGEST_STANDSTILL = 10.0
"""s by the wall clock; a world that has stood still for longer is taken for dead."""


class Ages:
    """Instants by name."""

    def __init__(self, world_time: Callable[[], float | None] = lambda: None) -> None:
        """world_time: of the simulated world, s; None: there is none, or it is not known."""
        self._world_time = world_time
        self._marks: dict[str, tuple[float, float | None]] = {}

    def mark(self, name: str, now: float) -> None:
        """Something is new; now: by the wall clock, s."""
        self._marks[name] = (now, self._world_time())

    def age(self, name: str, now: float) -> float:
        """s since the last mark; infinite without one."""
        marked = self._marks.get(name)
        if marked is None:
            return math.inf
        wall = now - marked[0]
        world = self._world_time()
        if world is None or marked[1] is None or wall > LONGEST_STANDSTILL:
            return wall
        return min(wall, max(0.0, world - marked[1]))

    @property
    def simulated(self) -> bool:
        """Whether a simulated world's time is known."""
        return self._world_time() is not None
