"""Commands that PX4 takes beside those of MAVSDK, as pymavlink scripts and older stations send them."""

from __future__ import annotations

import math
import struct

import pytest
from pymavlink.dialects.v20 import common as mavlink

from sitl_bridge.frames import euler_from_quaternion
from tests.controller.ground.in_flight import ACCEPTED, DENIED, REJECTED, flying, mode
from tests.controller.ground.kinematic import ZURICH
from tests.controller.ground.missions.test_missions import SQUARE, Uploader, other, waypoint
from tests.controller.ground.rig import NAN, Client, Rig

CANCELLED = 6
AMSL, RELATIVE = 0, 3


def ready() -> tuple[Rig, Client]:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    return rig, client


def test_mission_start_arms_and_flies() -> None:
    rig, client = ready()
    assert Uploader(client, SQUARE).run() == 0
    assert client.command(300, 0, 0).result == ACCEPTED
    assert rig.station.armed
    rig.run_until(lambda: "Mission finished; holding" in client.texts(), 200.0)


def test_mission_start_without_an_item_does_not_arm() -> None:
    rig, client = ready()
    assert Uploader(client, SQUARE).run() == 0
    assert client.command(300, NAN).result == ACCEPTED
    assert not rig.station.armed
    assert mode(rig) == "MISSION"


def test_mission_start_that_cannot_arm_says_why_and_leaves_the_mode() -> None:
    rig, client = ready()
    assert Uploader(client, SQUARE).run() == 0
    rig.view.health.gps = False
    assert client.command(300, 0, 0).result == REJECTED
    assert any("GPS not ready" in text for text in client.texts())
    rig.view.health.gps = True
    assert not rig.station.armed
    assert mode(rig) == "HOLD"


@pytest.mark.parametrize(("frame", "up"), [(RELATIVE, 9.0), (AMSL, 9.0 + ZURICH[2]), (NAN, 9.0 + ZURICH[2])])
def test_the_altitude_is_changed_above_where_it_is(frame: float, up: float) -> None:
    rig, client = flying()
    before = rig.view.position
    assert client.command(186, up, frame).result == ACCEPTED
    rig.run(20.0)
    assert mode(rig) == "HOLD"
    assert rig.view.position == pytest.approx((*before[:2], 9.0), abs=0.1)


def test_an_altitude_outside_the_fence_or_on_the_ground_is_not_flown_to() -> None:
    _rig, client = flying()
    assert client.command(186, math.inf, RELATIVE).result == DENIED
    _rig, client = ready()
    assert client.command(186, 9.0, RELATIVE).result == REJECTED


def heading_error(rig: Rig, east: float, north: float) -> float:
    x, y, _ = rig.view.position
    yaw = euler_from_quaternion(rig.view.attitude)[2]
    return abs(math.remainder(yaw - math.atan2(north - y, east - x), 2 * math.pi))


@pytest.mark.parametrize("command", [195, 201, 80])
@pytest.mark.parametrize("as_int", [False, True])
def test_the_yaw_points_at_a_region_of_interest_until_it_is_taken_back(command: int, as_int: bool) -> None:
    rig, client = flying()
    north = ZURICH[0] - 50.0 / 111_200.0  # degrees
    kind = 0.0 if command == 195 else 3.0
    if as_int:
        x, y = round(north * 1e7), round(ZURICH[1] * 1e7)
        assert client.command_int(command, (kind, 0, 0, 0), x, y, 2.0, RELATIVE).result == ACCEPTED
    else:
        assert client.command(command, kind, 0, 0, 0, north, ZURICH[1], 490.0).result == ACCEPTED
    rig.run(10.0)
    assert heading_error(rig, 0.0, -50.0) < 0.05
    client.command(192, -1, 1, 0, NAN, ZURICH[0], ZURICH[1] + 30.0 / 75_500.0, NAN)
    rig.run(30.0)
    assert rig.view.position[0] == pytest.approx(30.0, abs=0.5)
    assert heading_error(rig, 0.0, -50.0) < 0.05  # on the way and there, too
    assert client.command(197).result == ACCEPTED
    client.command(192, -1, 1, 0, NAN, ZURICH[0], ZURICH[1], NAN)
    before = euler_from_quaternion(rig.view.attitude)[2]
    rig.run(30.0)
    assert euler_from_quaternion(rig.view.attitude)[2] == pytest.approx(before, abs=0.05)


def test_a_heading_that_is_asked_for_takes_the_region_back() -> None:
    rig, client = flying()
    client.command(195, 0, 0, 0, 0, ZURICH[0] + 1e-3, ZURICH[1], 490.0)
    client.command(192, -1, 1, 0, math.pi / 2, ZURICH[0], ZURICH[1] + 1e-4, NAN)  # nose to the east
    rig.run(30.0)
    assert euler_from_quaternion(rig.view.attitude)[2] == pytest.approx(0.0, abs=0.05)


def test_a_region_of_interest_in_a_mission_looks_where_the_command_says() -> None:
    rig, client = flying()
    assert Uploader(client, [waypoint(20, 0), waypoint(20, 20), waypoint(0, 20)]).run() == 0
    client.command(300, 0, 0)
    assert client.command(201, 2, 2).result == ACCEPTED  # the plan's item 2
    rig.run(15.0)
    assert mode(rig) == "MISSION"
    assert heading_error(rig, 20.0, 0.0) < 0.05


@pytest.mark.parametrize("params", [(201, 2, 7), (201, 2, NAN), (195, 0, 0, 0, 0, NAN, 8.0, 5.0), (195,)])
def test_a_region_that_is_no_place_is_denied(params: tuple[float, ...]) -> None:
    _rig, client = flying()
    assert client.command(*params).result == DENIED  # type: ignore[arg-type]
    assert "Region of interest denied" in client.texts()[-1]


def test_a_planned_landing_is_gone_to() -> None:
    rig, client = flying()
    assert client.command(189).result == CANCELLED
    assert "no DO_LAND_START" in client.texts()[-1]
    land = (6, 21, 1, 0.0, 0.0, 0.0, NAN, round(ZURICH[0] * 1e7), round(ZURICH[1] * 1e7), 0.0)
    assert Uploader(client, [waypoint(60, 0), other(189), land]).run() == 0
    assert client.command(189).result == ACCEPTED
    assert rig.station.machine.mission.current >= 1
    rig.run_until(lambda: not rig.station.armed, 90.0)


def test_a_landing_is_broken_off_by_go_around() -> None:
    rig, client = flying()
    client.command(21)
    rig.run(1.0)
    assert client.command(191).result == ACCEPTED
    assert mode(rig) == "HOLD"
    rig.run(5.0)
    assert client.command(191).result == ACCEPTED  # and changes nothing without one
    assert rig.station.armed


@pytest.mark.parametrize(
    ("base", "main", "sub", "expected"),
    [
        (1, 4, 0, "MISSION"),  # AUTO without a sub-mode
        (1, 4, 9, "LAND"),  # precision landing without a beacon
        (mavlink.MAV_MODE_AUTO_ARMED, 0, 0, "MISSION"),
        (mavlink.MAV_MODE_FLAG_AUTO_ENABLED, NAN, NAN, "MISSION"),
    ],
)
def test_modes_that_px4_names_otherwise(base: float, main: float, sub: float, expected: str) -> None:
    rig, client = flying()
    assert Uploader(client, SQUARE).run() == 0
    assert client.command(176, base, main, sub).result == ACCEPTED
    assert mode(rig) == expected


def test_auto_may_be_asked_for_before_the_mission_is_uploaded() -> None:
    """As DroneKit's scripts for PX4 do: MAV_MODE_AUTO (4), upload, arm."""
    rig, client = ready()
    assert client.command(176, 4).result == ACCEPTED
    assert mode(rig) == "MISSION"
    assert client.command(400, 1).result == REJECTED
    assert "there is no mission" in client.texts()[-1]
    assert Uploader(client, SQUARE).run() == 0
    assert client.command(400, 1).result == ACCEPTED
    rig.run_until(lambda: "Mission finished; holding" in client.texts(), 200.0)


def test_auto_without_a_mission_is_denied_in_flight() -> None:
    rig, client = flying()
    assert client.command(176, 4).result == DENIED
    assert mode(rig) == "HOLD"


def test_slow_sticks_and_guided_flags_are_position_mode() -> None:
    rig, client = flying()
    for asked in ((1, 3, 2), (mavlink.MAV_MODE_GUIDED_ARMED, 0, 0)):
        assert client.command(176, *asked).result == REJECTED
        assert "Position denied: no sticks" in client.texts()[-1]
    assert client.command(176, mavlink.MAV_MODE_STABILIZE_ARMED).result == DENIED
    assert mode(rig) == "HOLD"


def test_an_actuator_that_is_not_there_takes_any_value() -> None:
    _rig, client = ready()
    assert client.command(187, 0.5).result == ACCEPTED
    assert "no effect" in client.texts()[-1]


def test_the_magnetometer_is_calibrated_by_the_heading_too() -> None:
    _rig, client = ready()
    assert client.command(42006, 90.0).result == ACCEPTED
    assert "[cal] calibration done: mag" in client.texts()


def test_old_requests_for_single_messages() -> None:
    rig, client = flying()
    client.clear()
    assert client.command(410).result == ACCEPTED
    assert client.got("HOME_POSITION")
    assert client.command(519, 1).result == ACCEPTED
    sent = [raw for raw in client.raw if raw[7:10] == (300).to_bytes(3, "little")]
    versions = [raw[10 : 10 + raw[1]].ljust(6, b"\0") for raw in sent]
    assert [struct.unpack("<HHH", version) for version in versions] == [(200, 100, 200)]
    assert client.command(528, 1).result == ACCEPTED
    information = client.got("FLIGHT_INFORMATION")[-1]
    assert 0 < information.arming_time_utc <= information.takeoff_time_utc
    assert information.takeoff_time_utc <= rig.view.time * 1e6
    assert information.flight_uuid == 1
