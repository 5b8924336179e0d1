"""Where a plan has the vehicle look; the load does not care."""

from __future__ import annotations

import math
from collections.abc import Callable

from controller.ground.missions.item_types import ROI, ROI_LOCATION, ROI_NEXT
from controller.ground.missions.mission_plan import Item
from sitl_bridge.frames import Triple

_CLOSE = 0.5
"""m, horizontally, within which a place gives no heading"""
_NEXT, _ITEM, _LOCATION = 1, 2, 3
"""DO_SET_ROI's param1"""
_KINDS = {ROI_LOCATION: _LOCATION, ROI_NEXT: _NEXT}


class RegionOfInterest:
    """A place, or the way-point that is flown to, or nothing."""

    def __init__(self) -> None:
        self._place: Triple | None = None
        self._next = False

    def point_at(self, item: Item, items: tuple[Item, ...], place: Callable[[Item], Triple]) -> None:
        """Look where a DO_SET_ROI item says; any other kind than these ends it."""
        kind = (
            item.p1 if item.command == ROI else {ROI_LOCATION: _LOCATION, ROI_NEXT: _NEXT}.get(item.command)
        )
        self._place, self._next = None, kind == _NEXT
        if kind == _LOCATION:
            self._place = place(item)
        elif kind == _ITEM and items[int(item.p2)].has_place:
            self._place = place(items[int(item.p2)])

    def yaw(self, here: Triple, waypoint: Triple | None) -> float:
        """Heading towards it, rad ENU, from a position of the vehicle, m; NaN: as it is."""
        there = waypoint if self._next else self._place
        if there is None:
            return math.nan
        east, north = there[0] - here[0], there[1] - here[1]
        return math.nan if math.hypot(east, north) < _CLOSE else math.atan2(north, east)
