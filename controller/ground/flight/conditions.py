"""CONDITION_DELAY and CONDITION_DISTANCE: they hold back the actions that follow, and never the flight.

As MAVLink has it, the vehicle goes on to the next place of the plan at once. The actions between the
condition and that place are done on the way, in their order, when their condition holds; those for which it
has not held when the place is left are skipped. Where no place follows, a delay is waited for.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from controller.ground.missions.item_types import CONDITION_DELAY, CONDITION_DISTANCE, JUMP, WITH_POSITION
from controller.ground.missions.mission_plan import Item

CONDITIONS = (CONDITION_DELAY, CONDITION_DISTANCE)


class Section(NamedTuple):
    """What lies between a condition and the next place."""

    held_back: tuple[Item, ...]
    """Conditions and actions, in order"""
    place: int
    """Index of the item with the place"""


def section_after(items: tuple[Item, ...], start: int) -> Section | None:
    """The section that the condition at `start` begins; None if no place follows, or a jump before it."""
    for index in range(start, len(items)):
        if items[index].command in WITH_POSITION:
            return Section(items[start:index], index)
        if items[index].command == JUMP:
            return None
    return None


class HeldBack:
    """The actions that wait on the way to a place."""

    def __init__(self, items: tuple[Item, ...], time: float) -> None:
        """time: s, at which the first condition begins."""
        self._items = deque(items)
        self._began = time

    def due(self, time: float, distance: float) -> list[Item]:
        """Actions whose turn has come. time: s; distance: m, to the place ahead."""
        out: list[Item] = []
        while self._items:
            first = self._items[0]
            if first.command == CONDITION_DELAY and time - self._began < first.p1:
                break
            if first.command == CONDITION_DISTANCE and distance > first.p1:
                break
            self._items.popleft()
            if first.command in CONDITIONS:
                self._began = time
            else:
                out.append(first)
        return out
