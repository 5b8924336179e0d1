"""Geofence plans and rally points: kept, enforced, returned to."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.limits.fence_zones import Zone, crosses, outside
from tests.controller.ground.in_flight import flying
from tests.controller.ground.missions.test_missions import ACCEPTED, Uploader, download, same, waypoint
from tests.controller.ground.rig import Client, Rig

FENCE, RALLY = mavlink.MAV_MISSION_TYPE_FENCE, mavlink.MAV_MISSION_TYPE_RALLY
UNSUPPORTED = mavlink.MAV_MISSION_UNSUPPORTED
PARAM1 = mavlink.MAV_MISSION_INVALID_PARAM1


def at(command: int, north: float, east: float, p1: float = 0.0, frame: int = 0) -> tuple[Any, ...]:
    return (frame, command, 1, p1, 0.0, 0.0, 0.0, *waypoint(north, east)[7:9], 0.0)


def square(half: float, inclusion: bool = True, north: float = 0.0) -> list[tuple[Any, ...]]:
    corners = [(-half, -half), (-half, half), (half, half), (half, -half)]
    return [at(5001 if inclusion else 5002, north + n, e, 4.0) for n, e in corners]


def uploaded(rig: Rig, client: Client, items: list[tuple[Any, ...]], kind: int = FENCE) -> None:
    assert Uploader(client, items, kind).run() == ACCEPTED, client.texts()


def test_all_three_plans_are_kept_apart_and_cleared() -> None:
    rig = Rig()
    client = rig.client()
    plans = {
        0: [waypoint(3, 3)],
        FENCE: [*square(50), at(5004, 20, 20, 3.0)],
        RALLY: [at(5100, 9, 9, frame=3)],
    }
    for kind, items in plans.items():
        uploaded(rig, client, items, kind)
    for kind, items in plans.items():
        assert same(download(client, plan=kind), items)
    client.send(mavlink.MAVLink_mission_clear_all_message(1, 1, FENCE))
    rig.run(0.04)
    assert [len(download(client, plan=kind)) for kind in plans] == [1, 0, 1]
    client.clear()
    client.send(mavlink.MAVLink_mission_clear_all_message(1, 1, 255))
    rig.run(0.04)
    assert [(ack.type, ack.mission_type) for ack in client.got("MISSION_ACK")] == [(ACCEPTED, 255)]
    assert [len(download(client, plan=kind)) for kind in plans] == [0, 0, 0]


@pytest.mark.parametrize(
    ("items", "kind", "result", "words"),
    [
        (square(9)[:3], FENCE, PARAM1, "polygon of 4 corners"),
        ([at(5001, 0, 0, 2.0)] * 2, FENCE, PARAM1, "polygon of 2 corners"),
        ([at(5001, 0, 0, math.nan)], FENCE, PARAM1, "polygon"),
        ([at(5001, 0, 0, 0.0)], FENCE, PARAM1, "polygon of 0 corners"),
        ([at(5003, 0, 0, -5.0)], FENCE, PARAM1, "radius -5"),
        ([at(5003, 0, 0, math.inf)], FENCE, PARAM1, "radius inf"),
        ([waypoint(0, 0)], FENCE, UNSUPPORTED, "command 16"),
        ([at(5003, 0, 0, 5.0, frame=7)], FENCE, mavlink.MAV_MISSION_UNSUPPORTED_FRAME, "frame 7"),
        ([waypoint(0, 0)], RALLY, UNSUPPORTED, "command 16"),
    ],
)
def test_bad_plans_change_nothing(items: Any, kind: int, result: int, words: str) -> None:
    rig = Rig()
    client = rig.client()
    kept = square(50) if kind == FENCE else [at(5100, 9, 9)]
    uploaded(rig, client, kept, kind)
    assert Uploader(client, items, kind).run() == result
    assert words in client.texts()[-1]
    assert same(download(client, plan=kind), kept)


@given(st.floats(-20, 20), st.floats(-20, 20))
def test_a_square_contains_what_its_sides_enclose(east: float, north: float) -> None:
    zone = Zone(True, ((-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)), 0.0)
    inside = -9.0 < east < 9.0 and -9.0 < north < 9.0
    on_edge = max(abs(east), abs(north)) == 9.0
    assert on_edge or zone.contains((east, north)) == inside


def test_one_inclusion_of_several_is_enough_and_no_exclusion_is_allowed() -> None:
    zones = (
        Zone(True, ((0.0, 0.0),), 5.0),
        Zone(True, ((20.0, 0.0),), 5.0),
        Zone(False, ((0.0, 0.0),), 1.0),
    )
    assert outside(zones, (20.0, 3.0)) == ""
    assert outside(zones, (3.0, 0.0)) == ""
    assert "exclusion" in outside(zones, (0.5, 0.0))
    assert "inclusion" in outside(zones, (10.0, 0.0))


def test_points_and_plans_outside_are_refused() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    uploaded(rig, client, [*square(30), at(5004, 10, 0, 3.0)])
    for north, words in ((40, "every inclusion zone"), (10, "exclusion zone 1")):
        assert Uploader(client, [waypoint(north, 0)]).run() == mavlink.MAV_MISSION_DENIED
        assert words in client.texts()[-1]


def test_a_fence_that_is_left_is_reacted_to_once() -> None:
    rig, client = flying()
    uploaded(rig, client, [at(5004, 0, 0, 10.0)])
    rig.run(1.0)
    assert rig.station.machine.mode.name == "RTL"
    assert [t for t in client.texts() if "geofence: returning" in t] == [
        "Vehicle inside exclusion zone 0 of the geofence: returning"
    ]


def test_a_load_that_leaves_the_fence_counts_too() -> None:
    rig, client = flying()
    uploaded(rig, client, square(5))
    rig.frozen = True
    rig.view.load_position = (6.0, 0.0, rig.view.load_position[2])
    rig.run(0.5)
    assert "Load outside every inclusion zone of the geofence: returning" in client.texts()


@pytest.mark.parametrize(("kind", "place"), [(0, (30.0, 0.0)), (1, (30.0, 0.0)), (2, (0.0, 0.0))])
def test_return_goes_where_rtl_type_says(kind: int, place: tuple[float, float]) -> None:
    rig, client = flying()
    rig.station.parameters.set("RTL_TYPE", float(kind))
    uploaded(rig, client, [at(5100, 300, 0), at(5100, 0, 30)], RALLY)
    there = waypoint(0, 20)
    assert client.command_int(192, (-1, 1, 0, math.nan), *there[7:9], 6.0, frame=6).result == 0
    rig.run(40.0)
    assert client.command(20).result == 0
    rig.run_until(lambda: not rig.station.armed, 200)
    assert rig.view.load_position[:2] == pytest.approx(place, abs=1.1)  # the load lay a metre from home


def test_a_circle_without_a_radius_is_no_zone() -> None:
    """MAVSDK-Python's examples/geofence.py sends one beside its polygon."""
    rig = Rig()
    client = rig.client()
    items = [*square(9), at(5003, -2e6, 0, 0.0)]
    uploaded(rig, client, items)
    assert same(download(client, plan=FENCE), items)
    assert Uploader(client, [waypoint(5, 5)]).run() == ACCEPTED
    uploaded(rig, client, items[4:])
    assert Uploader(client, [waypoint(50, 5)]).run() == ACCEPTED


@pytest.mark.parametrize("zone", [square(3, inclusion=False, north=20), [at(5004, 20, 0, 3.0)]])
def test_a_plan_whose_way_crosses_an_exclusion_zone_is_taken_with_a_warning(zone: Any) -> None:
    rig = Rig()
    client = rig.client()
    warning = "The way to mission item 1 crosses exclusion zone 0 of the geofence"
    uploaded(rig, client, zone)
    assert Uploader(client, [waypoint(0, 10), waypoint(40, -10)]).run() == ACCEPTED
    assert warning in client.texts()
    client.clear()
    assert Uploader(client, [waypoint(0, 10), waypoint(40, 10)]).run() == ACCEPTED
    assert not client.texts()
    uploaded(rig, client, [])
    assert Uploader(client, [waypoint(0, 10), waypoint(40, -10)]).run() == ACCEPTED
    assert not client.texts()
    uploaded(rig, client, zone)  # the other order: QGroundControl sends the fence after the mission
    rig.run(0.1)
    assert warning in client.texts()


PLACES = st.tuples(st.floats(-9, 9), st.floats(-9, 9))


@given(
    PLACES,
    PLACES,
    st.sampled_from(
        [
            Zone(False, ((-3.0, -3.0), (-3.0, 3.0), (3.0, 3.0), (3.0, -3.0)), 0.0),
            Zone(False, ((1.0, 1.0),), 4.0),
        ]
    ),
)
def test_a_way_crosses_a_zone_that_holds_one_of_its_points(a: Any, b: Any, zone: Zone) -> None:
    points = [(a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])) for s in (i / 200 for i in range(201))]
    if any(zone.contains(point) for point in points):
        assert crosses(zone, a, b)
    elif crosses(zone, a, b):  # a corner or rim between two of the points
        assert min(math.dist(p, q) for p in points for q in _rim(zone)) < 0.2


def _rim(zone: Zone) -> list[tuple[float, float]]:
    if zone.radius > 0:
        east, north = zone.corners[0]
        turns = [i / 360 * math.tau for i in range(360)]
        return [(east + zone.radius * math.cos(t), north + zone.radius * math.sin(t)) for t in turns]
    return [(x, y) for x in (-3.0, 3.0) for y in (-3.0, 3.0)]


def test_the_capabilities_say_fence_and_rally() -> None:
    rig = Rig()
    client = rig.client()
    client.command(512, 148)
    bits = client.got("AUTOPILOT_VERSION")[-1].capabilities
    assert bits & mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    assert bits & mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
