"""What a geofence allows, place by place."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.ground.flight.limits.fence import Fence, fence_around
from controller.ground.flight.limits.fence_zones import Zone, crosses, outside
from controller.ground.parameters.protocol import Parameters
from controller.ground.telemetry.vehicle_state import Profile
from sitl_bridge.frames import LocalOrigin

HOME = (10.0, -20.0, 3.0)
PROFILE = Profile("kinematic", 0, LocalOrigin(47.0, 8.0, 488.0), 1.5, 1.6, 9.81, True)


def fence(
    radius: float = 0.0, height: float = 0.0, least: float = 2.0, zones: tuple[Zone, ...] = ()
) -> Fence:
    return Fence(HOME, radius, height, least, zones)


def test_the_radius_is_around_home_and_its_edge_is_inside() -> None:
    allowed = fence(radius=5.0)
    assert allowed.outside((13.0, -16.0, 900.0)) == ""
    text = "6 m from home is outside the geofence of 5 m (GF_MAX_HOR_DIST)"
    assert allowed.outside((10.0, -14.0, 3.0)) == text
    assert allowed.outside((4.0, -20.0, 3.0)) == text
    assert allowed.outside((math.nan, -20.0, 3.0)) != ""


def test_the_height_counts_from_home_and_its_edge_is_inside() -> None:
    allowed = fence(height=4.0)
    assert allowed.outside((1e5, 0.0, 7.0)) == ""
    assert allowed.outside((10.0, -20.0, -50.0)) == ""
    expected = "6 m above home is outside the geofence of 4 m (GF_MAX_VER_DIST)"
    assert allowed.outside((10.0, -20.0, 9.0)) == expected
    assert allowed.outside((10.0, -20.0, math.nan)) != ""


def test_a_fence_of_less_than_a_metre_is_one() -> None:
    assert fence(radius=0.5).outside((11.0, -20.0, 3.0)) != ""
    assert fence(height=0.5).outside((10.0, -20.0, 4.0)) != ""


def test_without_limits_everything_is_allowed() -> None:
    assert fence().outside((1e6, 1e6, 1e6)) == ""


def test_zones_are_in_the_worlds_axes() -> None:
    zone = Zone(True, ((0.0, 0.0),), 5.0)
    assert fence(zones=(zone,)).outside((0.0, 4.0, 100.0)) == ""
    assert fence(zones=(zone,)).outside((10.0, -20.0, 3.0)) == "outside every inclusion zone of the geofence"


def test_too_low_for_the_load_by_more_than_a_centimetre() -> None:
    limited = fence(least=2.0)
    assert limited.too_low((0.0, 0.0, 4.995)) == ""
    expected = "1.5 m above home is too low for the load; at least 2.0 m (LND_CLEARANCE)"
    assert limited.too_low((0.0, 0.0, 4.5)) == expected
    assert limited.too_low((0.0, 0.0, 4.985)) != ""
    assert fence(least=-math.inf).too_low((0.0, 0.0, -1e6)) == ""


def test_a_place_too_low_is_raised_and_no_other() -> None:
    assert fence(least=2.0).raised((1.0, 2.0, 4.0)) == (1.0, 2.0, 5.0)
    assert fence(least=2.0).raised((1.0, 2.0, 6.0)) == (1.0, 2.0, 6.0)
    assert fence(least=-math.inf).raised((1.0, 2.0, -50.0)) == (1.0, 2.0, -50.0)


def test_the_fence_of_the_parameters() -> None:
    parameters = Parameters()
    parameters.set("GF_MAX_HOR_DIST", 500.0)
    parameters.set("GF_MAX_VER_DIST", 120.0)
    parameters.set("LND_CLEARANCE", 0.75)
    zones = (Zone(True, ((0.0, 0.0),), 5.0),)
    assert fence_around(HOME, parameters, PROFILE, zones=zones) == Fence(
        HOME, 500.0, 120.0, 1.6 + 0.75, zones
    )
    assert fence_around(HOME, parameters, PROFILE, with_load=False).least_height == 0.75
    assert fence_around(HOME, parameters, PROFILE).zones == ()
    nowhere = Profile("in space", 0, PROFILE.origin, 1.5, 1.6, 9.81, False)
    assert fence_around(HOME, parameters, nowhere).least_height == -math.inf


# Zones


def test_a_circle_contains_its_edge() -> None:
    circle = Zone(True, ((2.0, 1.0),), 5.0)
    assert circle.contains((5.0, 5.0))
    assert not circle.contains((5.1, 5.0))
    small = Zone(True, ((2.0, 1.0),), 0.5)
    assert small.contains((2.4, 1.0))
    assert not small.contains((2.6, 1.0))


TRIANGLE = ((0.0, 0.0), (8.0, 2.0), (3.0, 9.0))
ARROW = ((0.0, 0.0), (6.0, 6.0), (0.0, 12.0), (2.0, 6.0))
"""Not convex: its notch is on the west side."""


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("corners", "place", "inside"),
    [
        (TRIANGLE, (3.0, 3.0), True),
        (TRIANGLE, (1.2, 3.0), True),
        (TRIANGLE, (0.8, 3.0), False),
        (TRIANGLE, (7.1, 3.0), True),
        (TRIANGLE, (7.5, 3.0), False),
        (TRIANGLE, (4.0, 0.5), False),
        (TRIANGLE, (3.0, 0.9), True),
        (TRIANGLE, (3.0, 10.0), False),
        (TRIANGLE, (3.0, -1.0), False),
        (TRIANGLE, (-3.0, 2.0), False),  # level with a corner
        (ARROW, (3.0, 6.0), True),
        (ARROW, (1.5, 6.0), False),
        (ARROW, (1.0, 2.0), True),
        (ARROW, (1.0, 10.0), True),
        (ARROW, (-1.0, 6.0), False),
        (ARROW, (7.0, 6.0), False),
    ],
)
def test_a_polygon_contains_what_its_corners_enclose_in_either_order(
    corners: tuple[tuple[float, float], ...], place: tuple[float, float], inside: bool, turned: bool
) -> None:
    assert Zone(True, corners[::-1] if turned else corners, 0.0).contains(place) == inside


def test_zones_together() -> None:
    near, far = Zone(True, ((0.0, 0.0),), 5.0), Zone(True, ((20.0, 0.0),), 5.0)
    hole = Zone(False, ((0.0, 0.0),), 1.0)
    zones = (near, far, hole)
    assert outside(zones, (20.0, 3.0)) == outside(zones, (3.0, 0.0)) == ""
    assert outside(zones, (0.5, 0.0)) == "inside exclusion zone 2 of the geofence"
    assert outside(zones, (10.0, 0.0)) == "outside every inclusion zone of the geofence"
    assert outside((hole,), (10.0, 0.0)) == ""
    assert outside((), (10.0, 0.0)) == ""


# Ways

SHAPES = {
    "triangle": Zone(False, TRIANGLE, 0.0),
    "arrow": Zone(False, ARROW, 0.0),
    "circle": Zone(False, ((4.0, 5.0),), 3.0),
    "small circle": Zone(False, ((4.0, 5.0),), 0.5),
}


@pytest.mark.parametrize("name", SHAPES)
def test_a_way_crosses_a_zone_if_a_place_on_it_is_inside(name: str) -> None:
    """Random ways, each looked at in a thousand places."""
    zone, rng = SHAPES[name], np.random.default_rng(1)
    seen = set()
    for _ in range(60):
        start, end = rng.uniform(-4.0, 14.0, (2, 2))
        places = start + np.linspace(0.0, 1.0, 1000)[:, None] * (end - start)
        inside = any(zone.contains((east, north)) for east, north in places.tolist())
        assert crosses(zone, (start[0], start[1]), (end[0], end[1])) == inside
        seen.add(inside)
    assert seen == {True, False}


SQUARE = Zone(False, ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)), 0.0)


@pytest.mark.parametrize(
    ("start", "end", "expected"),
    [
        ((1.0, 4.0), (3.0, 4.0), True),  # along a side
        ((-2.0, 4.0), (6.0, 4.0), True),
        ((-2.0, 2.0), (2.0, 6.0), True),  # touches a corner
        ((-2.0, 0.0), (0.0, 0.0), True),  # ends at one
        ((5.0, 4.0), (9.0, 4.0), False),  # in line with a side, beyond it
        ((4.0, 5.0), (4.0, 9.0), False),
        ((-9.0, 4.0), (-5.0, 4.0), False),
        ((4.0, -9.0), (4.0, -5.0), False),
        ((5.0, 5.0), (5.0, 5.0), False),  # no way at all
        ((2.0, 2.0), (2.0, 2.0), True),
        ((-0.5, 3.0), (0.5, 4.5), True),  # cuts a corner off
        ((-0.5, 3.5), (0.5, 4.9), False),
    ],
)
def test_ways_along_a_side_and_past_it(
    start: tuple[float, float], end: tuple[float, float], expected: bool
) -> None:
    assert crosses(SQUARE, start, end) == expected
    assert crosses(SQUARE, end, start) == expected


def test_ways_that_end_before_a_circle_or_touch_it() -> None:
    circle = Zone(False, ((4.0, 5.0),), 3.0)
    for start, end in (((-10.0, 5.0), (0.5, 5.0)), ((4.0, -9.0), (4.0, 1.5))):
        assert not crosses(circle, start, end)
        assert not crosses(circle, end, start)
    assert not crosses(circle, (8.0, 5.0), (8.0, 5.0))
    assert crosses(circle, (1.0, 5.0), (1.0, 5.0))  # on its edge
    assert crosses(circle, (7.0, 0.0), (7.0, 10.0))  # touches it
