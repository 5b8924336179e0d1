"""Areas of the geofence, and which places they allow."""

from __future__ import annotations

import math
from typing import NamedTuple

Place = tuple[float, float]
"""East and north, m"""


class Zone(NamedTuple):
    """An area of the geofence: a polygon's corners in order, or a circle's centre alone."""

    inclusion: bool
    corners: tuple[Place, ...]
    radius: float
    """m, of a circle; 0 for a polygon"""

    def contains(self, place: Place) -> bool:
        """Whether a place is inside."""
        if self.radius > 0:
            return math.dist(place, self.corners[0]) <= self.radius
        inside = False
        east, north = place
        before = self.corners[-1]
        for corner in self.corners:
            if (corner[1] > north) != (before[1] > north):
                share = (north - corner[1]) / (before[1] - corner[1])
                inside ^= east < corner[0] + share * (before[0] - corner[0])
            before = corner
        return inside


def outside(zones: tuple[Zone, ...], place: Place) -> str:
    """Why a place is not allowed, or an empty string; one inclusion of several is enough, as on PX4."""
    for index, zone in enumerate(zones):
        if not zone.inclusion and zone.contains(place):
            return f"inside exclusion zone {index} of the geofence"
    inclusions = [zone for zone in zones if zone.inclusion]
    if inclusions and not any(zone.contains(place) for zone in inclusions):
        return "outside every inclusion zone of the geofence"
    return ""
