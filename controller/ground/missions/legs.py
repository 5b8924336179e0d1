"""The straight ways from place to place of a plan, and the exclusion zones that they cross."""

from __future__ import annotations

from itertools import pairwise

from controller.ground.flight.limits.fence import Fence
from controller.ground.flight.limits.fence_zones import Zone, crosses
from controller.ground.missions.mission_plan import Item, place
from sitl_bridge.frames import Geodetic, LocalOrigin


def crossed_zones(
    items: tuple[Item, ...], origin: LocalOrigin, home: Geodetic, fence: Fence, zones: tuple[Zone, ...]
) -> list[str]:
    """What there is to say of a plan whose ways, from home on, lead through exclusion zones.

    Jumps are left out. The plan is flown all the same, as on PX4, until the geofence acts.
    """
    placed = [(index, item) for index, item in enumerate(items) if item.has_place]
    stops = [(-1, fence.home[:2]), *((index, place(item, origin, home)[:2]) for index, item in placed)]
    return [
        f"The way to mission item {index} crosses exclusion zone {number} of the geofence"
        for (_, start), (index, end) in pairwise(stops)
        for number, zone in enumerate(zones)
        if not zone.inclusion and crosses(zone, start, end)
    ]
