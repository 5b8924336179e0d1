"""Sticks: MANUAL_CONTROL in Position and Altitude mode, taking over, and their loss."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.motion.setpoint_types import Follow, Idle
from tests.controller.ground.flown import Flown
from tests.controller.ground.in_flight import (
    ACCEPTED,
    DENIED,
    REJECTED,
    flying,
    local_setpoint,
    mode,
    set_parameter,
    stream,
)
from tests.controller.ground.rig import Client, Rig

POSITION, ALTITUDE = (176, 1, 3, 0), (176, 1, 2, 0)
MIDDLE = (0, 0, 500, 0)


def sticks(x: int = 0, y: int = 0, z: int = 500, r: int = 0, target: int = 1) -> Any:
    """MANUAL_CONTROL as MAVSDK and QGroundControl send it."""
    return mavlink.MAVLink_manual_control_message(target, x, y, z, r, 0)


def by_hand(command: tuple[int, ...] = POSITION) -> tuple[Rig, Client]:
    """In the air, with a mode for sticks that are in the middle."""
    rig, client = flying()
    rig.run(3.0)
    stream(rig, client, sticks(), 0.3)
    assert client.command(*command).result == ACCEPTED
    return rig, client


@pytest.mark.parametrize("command", [POSITION, ALTITUDE])
def test_without_sticks_there_is_no_such_mode(command: tuple[int, ...]) -> None:
    _rig, client = flying()
    assert client.command(*command).result == REJECTED
    assert "no sticks; send MANUAL_CONTROL first" in client.texts()[-1]


@pytest.mark.parametrize("main", [1, 5, 7])
def test_modes_without_position_control_are_denied_with_the_reason(main: int) -> None:
    rig, client = flying()
    stream(rig, client, sticks(), 0.3)
    assert client.command(176, 1, main, 0).result == DENIED
    assert "no position control, which the load needs" in client.texts()[-1]


def test_the_stick_is_a_velocity_in_the_headings_frame() -> None:
    rig, client = by_hand()
    assert rig.station.machine.mode.custom_mode == 3 << 16
    rig.run(1.0 / 50)
    beat = client.got("HEARTBEAT")[-1]
    assert beat.base_mode & mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
    assert not beat.base_mode & mavlink.MAV_MODE_FLAG_AUTO_ENABLED
    set_parameter(rig, client, "MPC_XY_VEL_MAX", 4.0)
    yaw = 0.3  # of the kinematic vehicle
    for x, y, along, left in ((1000, 0, 4.0, 0.0), (-1000, 0, -4.0, 0.0), (0, 1000, 0.0, -4.0)):
        stream(rig, client, sticks(x, y), 0.2)
        assert isinstance(rig.target, Follow)
        east = along * math.cos(yaw) - left * math.sin(yaw)
        north = along * math.sin(yaw) + left * math.cos(yaw)
        assert rig.target.velocity == pytest.approx((east, north, 0.0), abs=1e-6)
    stream(rig, client, sticks(1000, 1000), 0.2)  # a square of sticks is a circle of speeds
    assert math.hypot(*rig.target.velocity[:2]) == pytest.approx(4.0)
    stream(rig, client, sticks(z=1000), 0.2)
    assert rig.target.velocity == pytest.approx((0.0, 0.0, 2.0))
    stream(rig, client, sticks(r=1000), 0.2)
    assert rig.target.yaw_rate < 0.0  # the stick's right is clockwise
    stream(rig, client, sticks(50, -90, 520, 99), 0.2)  # inside the dead zone
    assert rig.target.velocity == (0.0, 0.0, 0.0)
    assert rig.target.yaw_rate == 0.0


def test_the_curve_is_px4s() -> None:
    rig, client = by_hand()
    set_parameter(rig, client, "MPC_XY_VEL_MAX", 4.0)
    stream(rig, client, sticks(550), 0.2)
    share = 0.5  # (0.55 - 0.1) / 0.9
    assert math.hypot(*rig.target.velocity[:2]) == pytest.approx(4.0 * (0.4 * share + 0.6 * share**3))


def test_what_is_not_given_is_in_the_middle() -> None:
    rig, client = by_hand()
    stream(rig, client, sticks(0x7FFF, 0x7FFF, 0x7FFF, 1000), 0.2)
    assert rig.target.velocity == (0.0, 0.0, 0.0)
    stream(rig, client, sticks(*(0x7FFF,) * 4), 1.0)  # nothing at all is no stick
    assert mode(rig) == "RTL"


def test_altitude_mode_leans_and_coasts() -> None:
    rig, client = by_hand(ALTITUDE)
    stream(rig, client, sticks(1000), 1.0)
    slow = math.hypot(*rig.target.velocity[:2])
    stream(rig, client, sticks(1000), 1.0)
    fast = math.hypot(*rig.target.velocity[:2])
    assert 0.5 < slow < fast
    stream(rig, client, sticks(), 0.5)
    left = math.hypot(*rig.target.velocity[:2])
    assert 0.5 * fast < left < fast  # no brake


def test_throttle_takes_off_and_does_not_fly_the_load_into_the_ground() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    stream(rig, client, sticks(), 0.2)
    assert client.command(*POSITION).result == ACCEPTED
    assert client.command(400, 1).result == ACCEPTED
    stream(rig, client, sticks(), 2.0)
    assert rig.target == Idle(True)
    stream(rig, client, sticks(z=900), 12.0)
    assert rig.view.load_position[2] > 0.5
    stream(rig, client, sticks(z=0), 12.0)
    fence = rig.station.machine.fence
    assert fence is not None
    assert rig.view.position[2] > fence.home[2] + fence.least_height - 0.5
    assert not rig.view.load_on_ground
    assert any("goes down too far" in text for text in client.texts())


@pytest.mark.parametrize(
    ("action", "expected"), [(1, "HOLD"), (2, "RTL"), (3, "LAND"), (5, "TERMINATION"), (6, "HOLD")]
)
def test_lost_sticks_are_a_failsafe(action: int, expected: str) -> None:
    rig, client = by_hand()
    set_parameter(rig, client, "NAV_RCL_ACT", action)
    stream(rig, client, sticks(500), 1.0)
    rig.run(0.4)
    assert mode(rig) == "POSITION"
    rig.run(0.2)
    assert mode(rig) == expected
    assert any("No sticks for 0.5 s" in text for text in client.texts())
    assert rig.station.armed == (action not in (5, 6))


@pytest.mark.parametrize(("exceptions", "expected"), [(0, "RTL"), (2, "HOLD")])
def test_sticks_that_were_there_at_arming_are_missed_in_hold_unless_excepted(
    exceptions: int, expected: str
) -> None:
    rig = Rig()
    client = rig.client()
    set_parameter(rig, client, "COM_RCL_EXCEPT", exceptions)
    rig.before_step = lambda: client.send(sticks())
    rig.fly(client)
    rig.run(1.0)
    assert mode(rig) == "HOLD"
    rig.before_step = lambda: None
    rig.run(1.0)
    assert mode(rig) == expected


def test_sticks_that_never_were_are_no_loss() -> None:
    rig, _client = flying()
    rig.run(10.0)
    assert mode(rig) == "HOLD"


@pytest.mark.parametrize(("override", "expected"), [(0, "HOLD"), (1, "POSITION")])
def test_moving_a_stick_takes_over_from_an_automatic_mode(override: int, expected: str) -> None:
    rig, client = flying()
    set_parameter(rig, client, "COM_RC_OVERRIDE", override)
    stream(rig, client, sticks(), 1.0)
    assert mode(rig) == "HOLD"
    stream(rig, client, sticks(200), 0.5)
    assert mode(rig) == "HOLD"
    stream(rig, client, sticks(500), 0.3)
    assert mode(rig) == expected
    assert ("Pilot took over by sticks" in client.texts()) == bool(override)


@pytest.mark.parametrize(("action", "expected"), [(0, "POSITION"), (1, "ALTITUDE")])
def test_lost_offboard_goes_over_to_sticks_if_there_are_any(action: int, expected: str) -> None:
    rig, client = flying()
    set_parameter(rig, client, "COM_OBL_RC_ACT", action)
    stream(rig, client, local_setpoint(3, 2, -5), 0.3)
    client.command(176, 1, 6, 0)
    stream(rig, client, sticks(), 2.0)
    assert mode(rig) == expected


@pytest.mark.parametrize("source", [0, 4])
def test_sticks_that_do_not_count_are_said_to(source: int) -> None:
    rig, client = flying()
    set_parameter(rig, client, "COM_RC_IN_MODE", source)
    stream(rig, client, sticks(), 0.5)
    assert client.command(*POSITION).result == REJECTED
    assert any(f"COM_RC_IN_MODE is {source}" in text for text in client.texts())


def test_one_pilot_at_a_time() -> None:
    rig, client = by_hand()
    other = rig.client(14540, link=1)
    stream(rig, client, sticks(), 0.1)
    other.send(sticks(1000))
    rig.run(0.1)
    assert rig.target.velocity == (0.0, 0.0, 0.0)
    assert "Another client has the sticks" in other.texts()[-1]


def test_on_the_real_plant_the_load_follows_the_stick_and_stops() -> None:
    flown = Flown()
    client = flown.client()
    flown.take_off(client)
    flown.run(3.0)
    asked = [sticks()]
    due = [0.0]

    def send() -> None:
        if flown.now >= due[0]:
            due[0] = flown.now + 0.04  # QGroundControl's 25 Hz
            client.send(asked[0])

    flown.every_tick = send
    flown.run(0.2)
    assert client.command(*POSITION).result == ACCEPTED
    set_parameter(flown, client, "MPC_XY_VEL_MAX", 3.0)  # type: ignore[arg-type]
    view = flown.station.machine.view
    assert view is not None
    asked[0] = sticks(1000)
    flown.run(6.0)
    assert math.hypot(*view.load_velocity[:2]) == pytest.approx(3.0, abs=0.1)
    height = view.load_position[2]
    asked[0] = sticks()
    flown.run(10.0)
    assert math.hypot(*view.load_velocity) < 0.05
    place = np.array(view.load_position)
    assert abs(place[2] - height) < 0.1
    flown.run(4.0)
    assert np.linalg.norm(np.array(view.load_position) - place) < 0.05  # it stays where it stopped
