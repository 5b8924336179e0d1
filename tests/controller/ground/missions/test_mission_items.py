"""What each kind of mission item does, and plans that change in flight."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mavlink

from tests.controller.ground.kinematic import ZURICH
from tests.controller.ground.missions.test_missions import (
    ACCEPTED,
    Uploader,
    download,
    flown,
    other,
    same,
    waypoint,
)
from tests.controller.ground.rig import Client, Rig

NAN = math.nan
IDLE = {
    "camera": (206, 214, 202, 203, 200, 2000, 2001, 2003, 2500, 2501, 530, 531, 532, 260),
    "gimbal": (204, 205, 1000, 1001),
    "servo": (181, 182, 183, 184, 187),
    "gripper": (211,),
    "winch": (42600,),
}


def started(items: list[tuple[Any, ...]]) -> tuple[Rig, Client]:
    """Flying a plan."""
    rig = Rig()
    client = rig.client()
    assert Uploader(client, items).run() == ACCEPTED, client.texts()
    rig.fly(client)
    assert client.command(300, 0, 0).result == 0
    return rig, client


@pytest.mark.parametrize("what", IDLE)
def test_items_for_missing_hardware_are_accepted_named_once_and_passed(what: str) -> None:
    rig = Rig()
    client = rig.client()
    items = [waypoint(3, 0), *(other(number) for number in IDLE[what]), waypoint(3, 3)]
    assert flown(rig, client, items) == [0, len(items) - 1]
    assert [text.split(":")[0] for text in client.texts() if "No " in text] == [f"No {what} on this vehicle"]


def test_marks_and_delays_are_passed() -> None:
    items = [waypoint(3, 0), other(189), other(114, 5.0), other(112, 1.0), waypoint(3, 3)]
    rig = Rig()
    assert flown(rig, rig.client(), items) == [0, 4]


@pytest.mark.parametrize(("condition", "amount"), [(112, 3.0), (114, 12.0)])
def test_a_condition_holds_back_what_follows_and_not_the_flight(condition: int, amount: float) -> None:
    """CONDITION_DELAY in s, CONDITION_DISTANCE in m to the place ahead; then a speed, and the next place."""
    items = [waypoint(3, 0, radius=1.0), other(condition, amount), other(178, 1.0, 3.0), waypoint(40, 0)]
    rig, _ = started(items)
    mission = rig.station.machine.mission
    rig.run_until(lambda: mission.current == 3)
    began, speed = rig.now, mission.speed
    assert math.isnan(speed)
    rig.run_until(lambda: mission.speed == 3.0, 40.0)
    assert mission.current == 3
    if condition == 112:
        assert rig.now - began == pytest.approx(amount, abs=0.1)
        assert rig.view.position[1] > 5.0  # it did not wait
    else:
        assert 40.0 - rig.view.position[1] == pytest.approx(amount, abs=0.5)


def test_what_a_condition_holds_back_too_long_is_skipped() -> None:
    items = [waypoint(3, 0), other(112, 1e6), other(178, 1.0, 3.0), waypoint(9, 0), waypoint(9, 3)]
    rig = Rig()
    assert flown(rig, rig.client(), items) == [0, 3, 4]
    assert math.isnan(rig.station.machine.mission.speed)


def test_a_delay_without_a_place_to_go_to_is_waited_for() -> None:
    rig, _ = started([waypoint(3, 0), other(112, 5.0)])
    rig.run_until(lambda: rig.station.machine.mission.current == 1)
    began = rig.now
    rig.run_until(lambda: rig.station.machine.mode.name == "HOLD")
    assert rig.now - began == pytest.approx(5.0, abs=0.1)


def test_loiter_to_altitude_ends_at_the_altitude() -> None:
    at = waypoint(3, 0, 9.0)
    rig = Rig()
    assert flown(rig, rig.client(), [(at[0], 31, *at[2:]), waypoint(3, 3, 9.0)]) == [0, 1]
    assert rig.view.position[2] - rig.station.machine.home[2] == pytest.approx(9.0, abs=0.1)


@pytest.mark.parametrize(("command", "p1"), [(195, 0.0), (201, 3.0)])
def test_the_yaw_points_at_a_region_of_interest(command: int, p1: float) -> None:
    there = waypoint(0, 30)
    region = (6, command, 1, p1, 0.0, 0.0, 0.0, *there[7:])
    rig, _ = started([waypoint(3, 0), region, waypoint(12, 0, hold=1000.0)])
    rig.run_until(lambda: rig.view.position[1] > 11.5)
    rig.run(1.0)
    east, north = 30.0 - rig.view.position[0], -rig.view.position[1]
    assert rig.target.yaw == pytest.approx(math.atan2(north, east), abs=0.02)


def test_the_yaw_points_at_the_next_way_point_until_it_is_told_not_to() -> None:
    heading = (*waypoint(6, 6, hold=1000.0)[:6], 90.0, *waypoint(6, 6)[7:])
    rig, client = started([other(196), waypoint(20, 0), other(197), heading])
    rig.run_until(lambda: rig.view.position[1] > 5.0)
    assert rig.target.yaw == pytest.approx(math.pi / 2, abs=0.1)  # north
    rig.run_until(lambda: any(m.seq == 1 for m in client.got("MISSION_ITEM_REACHED")))
    rig.run(0.5)
    assert rig.target.yaw == pytest.approx(0.0, abs=1e-6)  # the item's own heading, east


def test_set_home() -> None:
    there = waypoint(20, 10)
    rig = Rig()
    home = (6, 179, 1, 0.0, 0.0, 0.0, 0.0, *there[7:])
    flown(rig, rig.client(), [waypoint(3, 0), home, waypoint(3, 3)])
    assert rig.station.machine.home[:2] == pytest.approx((10.0, 20.0), abs=0.2)


def test_points_550_m_away_are_flown_without_a_fence() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert Uploader(client, [waypoint(550, 0, 200.0)]).run() == ACCEPTED, client.texts()


def test_plans_of_ardupilot_load() -> None:
    """ArduPilot's files have home as item 0, on the ground."""
    rig = Rig()
    client = rig.client()
    home = (0, 16, 1, 0.0, 0.0, 0.0, 0.0, round(ZURICH[0] * 1e7), round(ZURICH[1] * 1e7), ZURICH[2])
    assert flown(rig, client, [home, waypoint(3, 0), (6, 94, *waypoint(3, 3)[2:])]) == [0, 1, 2]
    text = " ".join(client.texts())
    assert "(LND_CLEARANCE): 0" in text
    assert "No gripper on this vehicle: no effect of mission items 2" in text


def test_a_plan_that_is_being_flown_is_replaced_and_the_new_one_flown() -> None:
    rig, client = started([waypoint(50, 0)])
    rig.run(1.0)
    fresh = [waypoint(0, 4), waypoint(4, 4)]
    assert Uploader(client, fresh).run() == ACCEPTED
    assert same(download(client), fresh)
    rig.run_until(lambda: rig.station.machine.mission.state == mavlink.MISSION_STATE_COMPLETE, 60)
    assert rig.view.position[:2] == pytest.approx((4.0, 4.0), abs=0.6)


def test_a_plan_that_is_cleared_in_flight_ends_in_hold() -> None:
    rig, client = started([waypoint(50, 0)])
    client.send(mavlink.MAVLink_mission_clear_all_message(1, 1, 0))
    rig.run(0.04)
    assert client.got("MISSION_ACK")[-1].type == ACCEPTED
    assert rig.station.machine.mode.name == "HOLD"


def test_a_failed_acknowledgement_cancels_an_upload() -> None:
    rig = Rig()
    client = rig.client()
    upload = Uploader(client, [waypoint(1, 1), waypoint(2, 2)])
    upload.start()
    rig.run(0.04)
    cancelled = mavlink.MAV_MISSION_OPERATION_CANCELLED
    client.send(mavlink.MAVLink_mission_ack_message(1, 1, cancelled, 0))
    upload.item(0)
    upload.item(1)
    rig.run(6.0)
    assert client.got("MISSION_ACK") == []
    assert download(client) == []


def test_set_mission_current() -> None:
    rig = Rig()
    client = rig.client()
    assert client.command(224, 0).result == 4
    jump = other(177, 0, 1)
    assert Uploader(client, [waypoint(3, 0), waypoint(3, 3), jump, waypoint(0, 0)]).run() == ACCEPTED
    flight = rig.station.machine.mission
    assert client.command(224, 1).result == 0
    assert client.command(224, -1).result == 0
    assert flight.current == 1
    for seq in (4, -2):
        assert client.command(224, seq).result == 4  # FAILED
        assert flight.current == 1
    client.send(mavlink.MAVLink_mission_set_current_message(1, 1, 2))
    rig.run(0.04)
    assert flight.current == 0  # where the jump goes
    rig.fly(client)
    assert client.command(176, 1, 4, 4).result == 0
    rig.run_until(lambda: flight.state == mavlink.MISSION_STATE_COMPLETE, 100)
    assert [m.seq for m in client.got("MISSION_ITEM_REACHED")] == [0, 1, 0, 1, 3]


def test_a_reset_gives_the_jumps_back() -> None:
    rig, client = started([waypoint(3, 0), waypoint(3, 3), other(177, 0, 1), waypoint(3, 6)])
    rig.run_until(lambda: len(client.got("MISSION_ITEM_REACHED")) == 3)
    assert client.command(224, -1, 1).result == 0
    rig.run_until(lambda: rig.station.machine.mission.state == mavlink.MISSION_STATE_COMPLETE, 100)
    assert [m.seq for m in client.got("MISSION_ITEM_REACHED")] == [0, 1, 0, 1, 0, 1, 3]


def old_item(current: int, north: float, up: float) -> Any:
    place = (ZURICH[0] + north / 111_200, ZURICH[1])
    return mavlink.MAVLink_mission_item_message(1, 1, 0, 3, 16, current, 1, 0, 0, 0, 0, *place, up, 0)


def test_older_clients_go_to_a_point_and_change_the_height() -> None:
    rig = Rig()
    client = rig.client()
    client.send(old_item(2, 5, 6))
    rig.run(0.04)
    assert client.got("MISSION_ACK")[-1].type == mavlink.MAV_MISSION_DENIED  # on the ground
    rig.fly(client)
    client.send(old_item(2, 5, 6))
    rig.run(20.0)
    assert client.got("MISSION_ACK")[-1].type == ACCEPTED
    home = rig.station.machine.home
    assert rig.view.position[1] == pytest.approx(5.0, abs=0.6)
    client.send(old_item(3, 50, 9))
    rig.run(20.0)
    assert rig.view.position[2] - home[2] == pytest.approx(9.0, abs=0.2)
    assert rig.view.position[1] == pytest.approx(5.0, abs=0.7)
    assert rig.station.missions.items == ()
