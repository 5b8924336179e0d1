"""Where a plan has the vehicle look; the load does not care."""

from __future__ import annotations

import math
from collections.abc import Callable

from controller.ground.missions.item_types import ROI, ROI_LOCATION, ROI_NEXT
from controller.ground.missions.mission_plan import Item
from sitl_bridge.frames import Triple

_CLOSE = 0.5
"""m, horizontally, within which a place gives no heading"""
NEXT, ITEM, LOCATION = 1, 2, 3
"""DO_SET_ROI's param1"""
_KINDS = {ROI_LOCATION: LOCATION, ROI_NEXT: NEXT}


def kind_of(command: int, p1: float) -> float | None:
    """What a command or item of the family looks at, as DO_SET_ROI's param1; None or 0: nothing."""
    return p1 if command in ROI else _KINDS.get(command)


class RegionOfInterest:
    """A place, or the way-point that is flown to, or nothing."""

    def __init__(self) -> None:
        self._place: Triple | None = None
        self._next = False

    def point_at(self, item: Item, items: tuple[Item, ...], place: Callable[[Item], Triple]) -> None:
        """Look where a DO_SET_ROI item says; any other kind than these ends it."""
        kind = kind_of(item.command, item.p1)
        if kind == LOCATION:
            self.look_at(place(item))
        elif kind == ITEM and items[int(item.p2)].has_place:
            self.look_at(place(items[int(item.p2)]))
        else:
            self.look_at(None, next_waypoint=kind == NEXT)

    def look_at(self, place: Triple | None, next_waypoint: bool = False) -> None:
        """Look at a place, m ENU, or at the way-point that is flown to; at nothing without either."""
        self._place, self._next = place, next_waypoint

    def yaw(self, here: Triple, waypoint: Triple | None) -> float:
        """Heading towards it, rad ENU, from a position of the vehicle, m; NaN: as it is."""
        there = waypoint if self._next else self._place
        return math.nan if there is None else heading_to(here, there, math.nan)


def heading_to(here: Triple, there: Triple, default: float) -> float:
    """Heading from a place to another (m), rad ENU; the default where they are too close for one."""
    east, north = there[0] - here[0], there[1] - here[1]
    return default if math.hypot(east, north) < _CLOSE else math.atan2(north, east)
