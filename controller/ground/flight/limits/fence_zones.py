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


def crosses(zone: Zone, start: Place, end: Place) -> bool:
    """Whether the straight way from a place to another goes through a zone, or along its side."""
    if zone.contains(start) or zone.contains(end):
        return True
    if zone.radius > 0:
        return _distance(zone.corners[0], start, end) <= zone.radius
    corners = zone.corners
    return any(_meet(start, end, corners[i - 1], corners[i]) for i in range(len(corners)))


def _distance(point: Place, start: Place, end: Place) -> float:
    """m, from a point to the nearest of a straight way."""
    east, north = end[0] - start[0], end[1] - start[1]
    square = east * east + north * north
    along = (point[0] - start[0]) * east + (point[1] - start[1]) * north
    share = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
    return math.dist(point, (start[0] + share * east, start[1] + share * north))


def _meet(a: Place, b: Place, c: Place, d: Place) -> bool:
    """Whether the straight ways from a to b and from c to d have a point in common."""
    for i in range(2):  # ways in one line have it only if they overlap
        if max(min(a[i], b[i]), min(c[i], d[i])) > min(max(a[i], b[i]), max(c[i], d[i])):
            return False
    return _side(a, b, c) * _side(a, b, d) <= 0.0 and _side(c, d, a) * _side(c, d, b) <= 0.0


def _side(a: Place, b: Place, point: Place) -> float:
    """Positive to the left of the way from a to b, m²."""
    return (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0])


def outside(zones: tuple[Zone, ...], place: Place) -> str:
    """Why a place is not allowed, or an empty string; one inclusion of several is enough, as on PX4."""
    for index, zone in enumerate(zones):
        if not zone.inclusion and zone.contains(place):
            return f"inside exclusion zone {index} of the geofence"
    inclusions = [zone for zone in zones if zone.inclusion]
    if inclusions and not any(zone.contains(place) for zone in inclusions):
        return "outside every inclusion zone of the geofence"
    return ""
