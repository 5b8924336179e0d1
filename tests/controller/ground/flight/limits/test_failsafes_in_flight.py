"""Failsafes: what is lost, and what the vehicle does then."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.motion.setpoint_types import Idle, Terminate
from controller.ground.link.peers import SILENCE
from sitl_bridge.frames import quaternion_from_euler
from tests.controller.ground.in_flight import ACCEPTED, flying, local_setpoint, mode, set_parameter, stream
from tests.controller.ground.rig import Rig


@pytest.mark.parametrize(
    ("action", "expected"),
    [(0, "HOLD"), (1, "HOLD"), (2, "HOLD"), (5, "HOLD"), (3, "RTL"), (4, "LAND"), (6, "TERMINATION")],
)
def test_offboard_lost(action: int, expected: str) -> None:
    rig, client = flying()
    set_parameter(rig, client, "COM_OBL_RC_ACT", action)
    message = local_setpoint(3, 2, -5)
    stream(rig, client, message, 0.3)
    client.command(176, 1, 6, 0)
    stream(rig, client, message, 2.0)
    rig.run(0.9)
    assert mode(rig) == "OFFBOARD"
    rig.run(0.3)
    assert mode(rig) == expected
    assert any("No offboard set-point" in text for text in client.texts())


def test_offboard_lost_and_disarmed() -> None:
    rig, client = flying()
    set_parameter(rig, client, "COM_OBL_RC_ACT", 7)
    message = local_setpoint(3, 2, -5)
    stream(rig, client, message, 0.3)
    client.command(176, 1, 6, 0)
    rig.run(1.5)
    assert not rig.station.armed
    assert rig.target == Idle(False)


@pytest.mark.parametrize("timeout", [10.0, 40.0])
@pytest.mark.parametrize(
    ("action", "expected"), [(0, "HOLD"), (1, "HOLD"), (2, "RTL"), (3, "LAND"), (5, "TERMINATION")]
)
def test_ground_station_lost(action: int, expected: str, timeout: float) -> None:
    """Also when the time-out is longer than a silent peer is remembered."""
    rig = Rig()
    client = rig.client()
    client.heartbeat()
    rig.fly(client)
    set_parameter(rig, client, "NAV_DLL_ACT", action)
    set_parameter(rig, client, "COM_DL_LOSS_T", timeout)
    for _ in range(20):
        client.heartbeat()
        rig.run(1.0)
    rig.run(timeout - 1.5)
    assert mode(rig) == "HOLD"
    rig.run(1.0)
    assert mode(rig) == expected
    assert any("No ground station" in text for text in client.texts()) == (action != 0)


def test_a_lost_ground_station_stays_lost_until_one_is_heard() -> None:
    rig = Rig()
    client = rig.client()
    client.heartbeat()
    rig.fly(client)
    set_parameter(rig, client, "NAV_DLL_ACT", 1)
    rig.run(SILENCE + 10.0)
    assert "station" in rig.station.machine.failsafes.active
    client.heartbeat()
    rig.run(0.5)
    assert "station" not in rig.station.machine.failsafes.active


def test_one_of_two_ground_stations_is_enough_and_none_ever_is_no_loss() -> None:
    rig, client = flying()
    rig.run(20.0)
    assert mode(rig) == "HOLD"  # nobody has ever said that it is a ground station
    other = rig.client(14540, link=1)
    client.heartbeat()
    for _ in range(20):
        other.heartbeat()
        rig.run(1.0)
    assert mode(rig) == "HOLD"
    rig.run(11.0)
    assert mode(rig) == "RTL"


def test_battery() -> None:
    rig, client = flying()
    rig.view.battery_remaining = 0.14
    rig.run(0.1)
    assert mode(rig) == "HOLD"
    assert "low" in client.texts()[-1]
    rig.view.battery_remaining = 0.06
    rig.run(0.1)
    assert mode(rig) == "RTL"
    rig.view.battery_remaining = 0.04
    rig.run(0.1)
    assert mode(rig) == "LAND"
    assert client.got("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_EMERGENCY


@pytest.mark.parametrize(
    ("action", "expected"), [(1, "OFFBOARD"), (2, "HOLD"), (3, "RTL"), (4, "TERMINATION"), (5, "LAND")]
)
def test_geofence(action: int, expected: str) -> None:
    rig, client = flying()
    set_parameter(rig, client, "GF_ACTION", action)
    set_parameter(rig, client, "GF_MAX_HOR_DIST", 10.0)
    message = local_setpoint(0, 0, 0, mask=0b110111000111, vx=3.0)
    stream(rig, client, message, 0.3)
    client.command(176, 1, 6, 0)
    stream(rig, client, message, 4.5)
    assert mode(rig) == expected
    assert any("geofence" in text for text in client.texts())


@pytest.mark.parametrize(("action", "expected"), [(0, "MISSION"), (1, "HOLD"), (4, "TERMINATION")])
def test_link_to_the_plant_lost_and_back(action: int, expected: str) -> None:
    from tests.controller.ground.missions.test_missions import SQUARE, Uploader

    rig, client = flying()
    set_parameter(rig, client, "COM_HIL_LOSS_ACT", action)
    assert Uploader(client, SQUARE).run() == ACCEPTED
    client.command(300, 0, 0)
    rig.run(0.5)
    rig.frozen = True
    rig.view.hil_age = rig.station.parameters["COM_HIL_LOSS_T"] + 0.1
    rig.run(1.0)
    assert any("link to the plant lost" in text for text in client.texts())
    rig.frozen = False
    rig.view.hil_age = 0.0
    rig.run(0.1)
    assert mode(rig) == expected


def test_position_lost_lands_and_a_tumble_terminates() -> None:
    rig, _ = flying()
    rig.view.health.position = False
    rig.run(0.1)
    assert mode(rig) == "LAND"
    rig, _client = flying()
    rig.view.attitude = quaternion_from_euler((1.5, 0.0, 0.0))
    rig.run(0.02)
    assert rig.target == Terminate()
    assert not rig.station.armed


def test_a_milder_failsafe_does_not_stop_a_harder_one() -> None:
    rig, client = flying()
    client.command(21)
    rig.view.battery_remaining = 0.06
    rig.run(0.1)
    assert mode(rig) == "LAND"
