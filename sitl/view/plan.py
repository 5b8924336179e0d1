"""What is planned on board, as lines and points to draw: mission, geofence, rally points. World ENU, m."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.ground.flight.limits.fence_zones import Zone
from controller.ground.missions.mission_plan import Fault, Item, place
from controller.ground.missions.zones import rally_points_of, zones_of
from sitl_bridge.frames import LocalOrigin, Triple

CIRCLE_SIDES = 64


@dataclass(frozen=True)
class Plan:
    """The three plans of one vehicle."""

    waypoints: tuple[tuple[int, Triple], ...] = ()
    """Number of each mission item that names a place, and the place."""
    zones: tuple[Zone, ...] = ()
    rally: tuple[tuple[float, float], ...] = ()
    """East, north of each."""


NO_PLAN = Plan()


def plan_of(mission: Sequence[Item], fence: Sequence[Item], rally: Sequence[Item], home: LocalOrigin) -> Plan:
    """What can be drawn of the items; a fence or rally plan with an item that has no meaning is left out."""
    waypoints = [
        (index, place(item, home, home.home))
        for index, item in enumerate(mission)
        if item.has_place and all(map(math.isfinite, (item.x, item.y, item.z)))
    ]
    zones, points = zones_of(tuple(fence), home), rally_points_of(tuple(rally), home)
    return Plan(
        tuple(waypoints),
        () if isinstance(zones, Fault) else zones,
        () if isinstance(points, Fault) else points,
    )


def outline(zone: Zone, height: float) -> NDArray[np.float64]:
    """The zone's border at a height as a closed line, (n, 3)."""
    if zone.radius > 0.0:
        east, north = zone.corners[0]
        angles = np.linspace(0.0, 2.0 * np.pi, CIRCLE_SIDES + 1)
        places = np.column_stack((east + zone.radius * np.cos(angles), north + zone.radius * np.sin(angles)))
    else:
        places = np.array([*zone.corners, zone.corners[0]])
    return np.column_stack((places, np.full(len(places), height)))
