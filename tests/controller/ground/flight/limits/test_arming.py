"""What arming asks for, and what becomes of a vehicle that is armed and left alone."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.motion.setpoint_types import Idle
from sitl_bridge.frames import quaternion_from_euler
from tests.controller.ground.in_flight import ACCEPTED, REJECTED
from tests.controller.ground.rig import NAN, Rig


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"velocity": (0.0, 1.0, 0.0)}, "not at rest"),
        ({"load_velocity": (0.0, 1.0, 0.0)}, "not at rest"),
        ({"attitude": quaternion_from_euler((0.5, 0.0, 0.0))}, "tilted"),
        ({"hil_age": 2.0}, "no sensor data"),
        ({"hil_age": math.inf}, "no sensor data"),
        ({"battery_remaining": 0.1}, "battery"),
        ({"position": (math.nan, 0.0, 0.0)}, "beyond all bounds"),
    ],
)
def test_preconditions_of_arming_are_checked_and_said(change: dict[str, Any], words: str) -> None:
    rig = Rig()
    client = rig.client()
    rig.frozen = True
    rig.view = dataclasses.replace(rig.view, **change)
    rig.run(0.1)
    assert client.command(400, 1).result == REJECTED
    assert words in client.texts()[-1]
    assert not rig.station.armed
    assert client.command(400, 1, 21196).result == REJECTED  # force does not make a bad state good


@pytest.mark.parametrize("sensor", ["gyroscope", "magnetometer", "gps", "position", "load"])
def test_each_sensor_is_a_precondition(sensor: str) -> None:
    rig = Rig()
    client = rig.client()
    setattr(rig.view.health, sensor, False)
    rig.run(0.1)
    assert client.command(400, 1).result == REJECTED
    assert "not ready" in client.texts()[-1]
    client.command(512, 1)
    status = client.got("SYS_STATUS")[-1]
    assert status.onboard_control_sensors_enabled & 0x10000000
    assert not status.onboard_control_sensors_health & 0x10000000
    setattr(rig.view.health, sensor, True)
    assert client.command(400, 1).result == ACCEPTED


def test_there_is_no_home_before_arming_would_be_accepted() -> None:
    """MAVSDK's examples wait for a global position and a home, and arm at once."""
    rig = Rig()
    client = rig.client()
    rig.view.health.load = False
    rig.run(3.0)
    assert client.got("HOME_POSITION") == []
    rig.view.health.load = True
    rig.run(3.0)
    assert client.got("HOME_POSITION")
    assert client.command(400, 1).result == ACCEPTED


def test_before_the_first_sensor_data() -> None:
    rig = Rig()
    client = rig.client()
    client.send(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, *(NAN,) * 6))
    rig.station.update(rig.view, rig.now)
    rig.run(0.1)
    assert client.got("COMMAND_ACK")[0].result == REJECTED
    assert "start the plant" in client.texts()[0]


def test_armed_and_left_alone_it_disarms() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    client.command(400, 1)
    assert rig.target == Idle(True)
    rig.run(11.0)
    assert not rig.station.armed
    assert rig.target == Idle(False)
    assert "no take-off" in client.texts()[-1]
