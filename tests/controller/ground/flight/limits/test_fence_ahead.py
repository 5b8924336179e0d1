"""A way that leads out of the geofence is flown to the fence, and no further."""

from __future__ import annotations

import math

import pytest

from controller.ground.flight.limits.fence_zones import Zone
from tests.controller.ground.flight.limits.test_fence_and_rally import at, square, uploaded
from tests.controller.ground.in_flight import ACCEPTED, flying, mode, set_parameter
from tests.controller.ground.missions.test_missions import Uploader, waypoint
from tests.controller.ground.rig import Client, Rig

HOLD, RETURN, WARN, LAND = 2, 3, 1, 5
CIRCLE = [at(5004, 30, 0, 5.0)]
BOX = square(5, inclusion=False, north=30)
ZONES = {
    "circle": (CIRCLE, Zone(False, ((0.0, 30.0),), 5.0)),
    "box": (BOX, Zone(False, ((-5.0, 25.0), (5.0, 25.0), (5.0, 35.0), (-5.0, 35.0)), 0.0)),
}
"""The way north leads through each"""


def fly_watched(rig: Rig, zone: Zone, seconds: float) -> None:
    """Let time pass; neither body may be in the zone."""

    def watch() -> None:
        for body in (rig.view.position, rig.view.load_position):
            assert not zone.contains(body[:2]), (rig.now, body)

    rig.before_step = watch
    rig.run(seconds)


def across() -> tuple[Rig, Client]:
    rig, client = flying()
    assert Uploader(client, [waypoint(60, 0)]).run() == ACCEPTED
    return rig, client


@pytest.mark.parametrize("kind", ZONES)
@pytest.mark.parametrize("speed", [1.0, 3.0, 6.0])
def test_a_mission_holds_before_an_exclusion_zone_on_its_way(kind: str, speed: float) -> None:
    items, zone = ZONES[kind]
    rig, client = across()
    set_parameter(rig, client, "GF_ACTION", HOLD)
    set_parameter(rig, client, "MPC_XY_CRUISE", speed)
    uploaded(rig, client, items)
    assert client.command(300, 0, 0).result == ACCEPTED
    fly_watched(rig, zone, 60.0)
    assert "Geofence ahead: exclusion zone 0 of the geofence: holding" in client.texts()
    assert mode(rig) == "HOLD"
    assert 15.0 < rig.view.position[1] < 25.0
    assert math.hypot(*rig.view.velocity) < 0.05


@pytest.mark.parametrize(("action", "name"), [(RETURN, "RTL"), (LAND, "LAND")])
def test_the_other_actions_are_taken_there_too(action: int, name: str) -> None:
    items, zone = ZONES["box"]
    rig, client = across()
    set_parameter(rig, client, "GF_ACTION", action)
    uploaded(rig, client, items)
    client.command(300, 0, 0)
    modes = set()
    fly_watched(rig, zone, 5.0)
    for _ in range(200):
        rig.run(0.1)
        modes.add(mode(rig))
    assert name in modes
    assert any("Geofence ahead" in text for text in client.texts())


def test_a_warning_waits_until_the_fence_is_left() -> None:
    rig, client = across()
    set_parameter(rig, client, "GF_ACTION", WARN)
    uploaded(rig, client, CIRCLE)
    client.command(300, 0, 0)
    rig.run(60.0)
    assert [text for text in client.texts() if "geofence: warning only" in text] == [
        "Vehicle inside exclusion zone 0 of the geofence: warning only"
    ]
    assert rig.view.position[1] == pytest.approx(60.0, abs=1.5)


def test_sticks_and_set_points_are_stopped_at_the_fence() -> None:
    from pymavlink.dialects.v20 import common as mavlink

    items, zone = ZONES["circle"]
    rig, client = flying()
    set_parameter(rig, client, "GF_ACTION", HOLD)
    uploaded(rig, client, items)

    def north() -> None:
        for body in (rig.view.position, rig.view.load_position):
            assert not zone.contains(body[:2])
        mask = 0b110111000111  # velocities alone
        message = mavlink.MAVLink_set_position_target_local_ned_message
        client.send(message(0, 1, 1, 1, mask, 0, 0, 0, 4.0, 0, 0, 0, 0, 0, 0, 0))

    rig.before_step = north
    rig.run(0.1)
    assert client.command(176, 1, 6).result == ACCEPTED
    rig.run(40.0)
    assert mode(rig) == "HOLD"
    assert rig.view.position[1] < 25.0


@pytest.mark.parametrize("beside", [24.0, 24.9])
def test_a_point_just_before_the_fence_is_flown_to(beside: float) -> None:
    rig, client = flying()
    set_parameter(rig, client, "GF_ACTION", HOLD)
    uploaded(rig, client, [*BOX, *square(80)])
    assert Uploader(client, [waypoint(beside, 0)]).run() == ACCEPTED
    client.command(300, 0, 0)
    rig.run(60.0)
    assert "Mission finished; holding" in client.texts()
    assert not any("Geofence ahead" in text for text in client.texts())


def test_a_way_out_of_an_inclusion_is_stopped_before_its_side() -> None:
    """Of a shape with a bay: both ends of the way are inside."""
    rig, client = flying()
    set_parameter(rig, client, "GF_ACTION", HOLD)
    shape = [(-10, -10), (60, -10), (60, 10), (40, 10), (40, -5), (20, -5), (20, 10), (-10, 10)]
    uploaded(rig, client, [at(5001, n, e, len(shape)) for n, e in shape])
    assert Uploader(client, [waypoint(50, 0)]).run() == ACCEPTED
    client.command(300, 0, 0)
    rig.run(60.0)
    assert mode(rig) == "HOLD"
    assert 10.0 < rig.view.position[1] < 20.0
