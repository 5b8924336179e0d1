"""Going to points, pausing, speed; flown with the kinematic vehicle."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.motion.setpoint_types import Idle
from controller.ground.flight.motion.trajectory import stopping_distance
from tests.controller.ground.in_flight import ACCEPTED, DENIED, REJECTED, flying
from tests.controller.ground.kinematic import PROFILE, ZURICH
from tests.controller.ground.rig import NAN, Rig


def test_going_to_a_point_and_pausing() -> None:
    rig, client = flying()
    there = (ZURICH[0] + 1e-4, ZURICH[1], 488.0 + 4.0)
    ack = client.command_int(192, (-1, 1, 0, 0.0), round(there[0] * 1e7), round(there[1] * 1e7), there[2])
    assert ack.result == ACCEPTED
    rig.run(1.0)
    before = rig.view.position[1]
    assert client.command(192, -1, 1, 0, NAN, NAN, NAN, NAN).result == ACCEPTED  # QGroundControl's pause
    rig.run(3.0)
    north = rig.view.position[1]
    assert north == pytest.approx(before + stopping_distance(3.0, 2.0), abs=0.2)
    rig.run(3.0)
    assert rig.view.position[1] == pytest.approx(north, abs=1e-6)
    assert client.command(192, -1, 1, 0, NAN, *there).result == ACCEPTED
    rig.run(15.0)
    assert rig.view.position == pytest.approx((0.0, 11.12, 4.0), abs=0.05)
    # and the load hangs a cable's length below: the point was the vehicle's
    assert rig.view.load_position[2] == pytest.approx(4.0 - PROFILE.hover_length, abs=0.05)


@pytest.mark.parametrize(
    ("params", "words"),
    [
        ((-1, 1, 0, NAN, 91.0, 8.0, 492.0), "valid position"),
        ((-1, 1, 0, NAN, ZURICH[0], NAN, 492.0), "both or neither"),
        ((-1, 1, 0, NAN, ZURICH[0] + 1, ZURICH[1], 492.0), "GF_MAX_HOR_DIST"),
        ((-1, 1, 0, NAN, ZURICH[0], ZURICH[1], 800.0), "GF_MAX_VER_DIST"),
        ((-1, 1, 0, NAN, ZURICH[0], ZURICH[1], math.inf), "infinite"),
        ((-1, 1, 0, math.inf, ZURICH[0], ZURICH[1], 492.0), "infinite"),
    ],
)
def test_points_that_cannot_be_flown_to_are_refused(params: tuple[float, ...], words: str) -> None:
    rig, client = flying()
    rig.station.parameters.set("GF_MAX_HOR_DIST", 500.0)
    rig.station.parameters.set("GF_MAX_VER_DIST", 120.0)
    target = rig.station.update(rig.view, rig.now)
    assert client.command(192, *params).result == DENIED
    assert words in client.texts()[-1]
    assert rig.station.update(rig.view, rig.now) is target


def test_a_point_that_is_too_low_for_the_load_is_raised_and_said() -> None:
    rig, client = flying()
    assert client.command(192, -1, 1, 0, NAN, ZURICH[0], ZURICH[1], 489.0).result == ACCEPTED
    assert "Reposition limited: 0.9 m above home is too low for the load" in "".join(client.texts())
    rig.run(10.0)
    fence = rig.station.machine.fence
    assert fence is not None
    assert rig.view.position[2] == pytest.approx(fence.home[2] + fence.least_height, abs=0.01)


@pytest.mark.parametrize("wait", [0.0, 1.0, 3.0])
def test_a_point_during_take_off_is_flown_to_afterwards(wait: float) -> None:
    """MAVSDK-Python's examples/goto.py: take-off, and a second later a point far away."""
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(400, 1).result == ACCEPTED
    client.send(mavlink.MAVLink_command_long_message(1, 1, 22, 0, *(NAN,) * 7))
    rig.run(wait)
    there = (ZURICH[0] + 1e-4, ZURICH[1], 488.0 + 20.0)
    client.send(mavlink.MAVLink_command_long_message(1, 1, 192, 0, -1, 1, 0, NAN, *there))
    rig.run(0.1)
    assert [ack.result for ack in client.got("COMMAND_ACK")] == [ACCEPTED] * 3
    load = rig.view.load_position
    rig.run_until(lambda: rig.view.load_position[2] > 0.3)
    assert math.dist(rig.view.load_position[:2], load[:2]) < 0.05  # lifted where it lay
    rig.run_until(lambda: math.dist(rig.view.position, (0.0, 11.12, 20.0)) < 0.1)
    assert rig.station.machine.mode.name == "HOLD"
    assert "Reposition accepted: after take-off" in client.texts()


def test_a_point_that_waits_for_the_take_off_is_forgotten_when_something_else_is_asked_for() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    client.command(400, 1)
    client.command(22)
    assert client.command(192, -1, 1, 0, NAN, ZURICH[0] + 1e-4, ZURICH[1], 500.0).result == ACCEPTED
    assert client.command(176, 1, 4, 3).result == ACCEPTED
    rig.run(30.0)
    assert math.hypot(*rig.view.position[:2]) < 1.5


def test_a_point_after_the_load_was_set_down_takes_it_up_again() -> None:
    rig, client = flying()
    client.command(21)
    rig.run_until(lambda: rig.view.load_on_ground)
    rig.run(0.1)
    assert client.command(192, -1, 1, 0, NAN, ZURICH[0] + 1e-4, ZURICH[1], 500.0).result == ACCEPTED
    rig.run_until(lambda: math.dist(rig.view.load_position, (0.0, 11.12, 12.0 - PROFILE.hover_length)) < 0.1)


def test_on_the_ground_there_is_nowhere_to_go() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(192, -1, 1, 0, NAN, ZURICH[0], ZURICH[1], 492.0).result == REJECTED
    assert "take off first" in client.texts()[-1]


def test_speed() -> None:
    rig, client = flying()
    assert client.command(178, 1, 1.5, -1, 0).result == ACCEPTED
    rig.run(0.02)
    assert rig.target.speed == 1.5
    for bad in (100.0, 0.0, NAN, -3.0):
        assert client.command(178, 1, bad, -1, 0).result == DENIED


def test_the_target_is_the_same_object_while_nothing_changes() -> None:
    rig, _client = flying()
    rig.run(0.1)
    first = rig.target
    rig.run(3.0)
    assert rig.target is first


def test_at_a_fast_tick_the_machine_looks_seldom_and_commands_take_effect_at_once() -> None:
    rig, client = flying()
    machine = rig.station.machine
    looks = 0
    original = machine.update

    def counted(*arguments: Any) -> Any:
        nonlocal looks
        looks += 1
        return original(*arguments)

    machine.update = counted  # type: ignore[method-assign]
    for _ in range(250):
        rig.now += 0.001
        rig.view.time += 0.001
        rig.station.update(rig.view, rig.now)
    assert looks == pytest.approx(12.5, abs=1)
    client.send(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 0, 21196, *(NAN,) * 5))
    assert rig.station.update(rig.view, rig.now) == Idle(False)
