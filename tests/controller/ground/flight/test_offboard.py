"""Offboard set-points, and a controller that starts in flight."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest

from controller.ground.flight.motion.setpoint_types import Follow, Idle
from controller.ground.flight.motion.trajectory import stopping_distance
from controller.ground.telemetry.vehicle_state import profile_of
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.ground.in_flight import ACCEPTED, REJECTED, flying, local_setpoint, mode, stream
from tests.controller.ground.kinematic import PROFILE
from tests.controller.ground.rig import NAN, Rig


def test_offboard_needs_set_points_first() -> None:
    _rig, client = flying()
    assert client.command(176, 1, 6, 0).result == REJECTED
    assert "send them" in client.texts()[-1]


def test_offboard_position_velocity_and_trajectory() -> None:
    rig, client = flying()
    stream(rig, client, local_setpoint(3, 2, -5), 0.3)
    assert client.command(176, 1, 6, 0).result == ACCEPTED
    stream(rig, client, local_setpoint(3, 2, -5), 6.0)
    assert rig.view.position == pytest.approx((2, 3, 5), abs=0.05)
    stream(rig, client, local_setpoint(NAN, NAN, NAN, mask=0b111111000111, vx=1.0), 2.0)
    assert isinstance(rig.target, Follow)
    assert rig.target.velocity == pytest.approx((0, 1, 0))
    assert all(math.isnan(p) for p in rig.target.position)
    assert rig.view.position[1] == pytest.approx(5.0, abs=0.1)
    # body frame: forward is where the nose points
    yaw = math.pi / 2 - 1.0
    stream(rig, client, local_setpoint(0, 0, -5, yaw=1.0), 0.2)
    stream(rig, client, local_setpoint(0, 0, 0, mask=0b110111000111, frame=8, vx=1.0), 0.2)
    assert rig.target.velocity == pytest.approx((math.cos(yaw), math.sin(yaw), 0), abs=1e-6)
    full = local_setpoint(1, 2, -4, mask=0, vx=0.5, vy=0.25, vz=-0.1, afx=0.3, yaw=math.pi / 2, yaw_rate=0.2)
    stream(rig, client, full, 0.2)
    target = rig.target
    assert isinstance(target, Follow)
    assert target.velocity == pytest.approx((0.25, 0.5, 0.1))
    assert target.acceleration == pytest.approx((0, 0.3, 0), abs=1e-6)
    assert target.yaw == pytest.approx(0.0, abs=1e-6)
    assert target.yaw_rate == pytest.approx(-0.2)
    # the load lags below and behind the accelerating vehicle by the cable's length
    offset = [v - p for v, p in zip((2, 1, 4), target.position, strict=True)]
    assert math.hypot(*offset) == pytest.approx(PROFILE.hover_length)
    assert offset[1] > 0


def test_a_set_point_on_the_ground_waits_there_until_one_is_above_it() -> None:
    """MAVSDK-Python's examples/offboard_position_ned.py."""
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(400, 1).result == ACCEPTED
    stream(rig, client, local_setpoint(0, 0, 0), 0.3)
    assert client.command(176, 1, 6, 0).result == ACCEPTED
    stream(rig, client, local_setpoint(0, 0, 0), 3.0)
    assert rig.target == Idle(True)
    stream(rig, client, local_setpoint(0, 0, -5), 20.0)
    assert rig.view.position == pytest.approx((0, 0, 5), abs=0.05)
    assert mode(rig) == "OFFBOARD"


def test_a_velocity_lifts_off_when_it_goes_up() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    client.command(400, 1)
    stream(rig, client, local_setpoint(0, 0, 0, mask=0b111111000111), 0.3)
    client.command(176, 1, 6, 0)
    stream(rig, client, local_setpoint(0, 0, 0, mask=0b111111000111, vx=1.0), 1.0)
    assert rig.target == Idle(True)
    stream(rig, client, local_setpoint(0, 0, 0, mask=0b111111000111, vz=-1.0), 20.0)
    assert rig.view.load_position[2] > 1.0


def test_a_set_point_too_low_for_the_load_is_flown_as_low_as_may_be_and_said_once() -> None:
    rig, client = flying()
    stream(rig, client, local_setpoint(1, 1, 0.5), 0.3)
    assert client.command(176, 1, 6, 0).result == ACCEPTED
    stream(rig, client, local_setpoint(1, 1, 0.5), 6.0)
    fence = rig.station.machine.fence
    assert fence is not None
    assert rig.view.position == pytest.approx((1, 1, fence.home[2] + fence.least_height), abs=0.05)
    assert sum("Set-point goes down too far" in text for text in client.texts()) == 1


def test_a_set_point_of_the_load_is_the_loads() -> None:
    rig, client = flying()
    message = local_setpoint(0, 0, -3, system=101, component=35)
    stream(rig, client, message, 0.3)
    client.command(176, 1, 6, 0)
    stream(rig, client, message, 4.0)
    assert rig.view.load_position == pytest.approx((0, 0, 3), abs=0.05)


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (local_setpoint(0, 0, -5, mask=0b111111111111), "asks for nothing"),
        (local_setpoint(math.inf, 0, -5), "beyond all bounds"),
        (local_setpoint(0, 0, -5, frame=2), "frame 2"),
        (local_setpoint(9000, 0, -5), "GF_MAX_HOR_DIST"),
    ],
)
def test_set_points_that_cannot_be_flown_are_refused_and_do_not_count(message: Any, words: str) -> None:
    rig, client = flying()
    rig.station.parameters.set("GF_MAX_HOR_DIST", 500.0)
    stream(rig, client, message, 0.5)
    assert any(word in client.texts()[-1] for word in words.split("|"))
    assert client.command(176, 1, 6, 0).result == REJECTED


def test_set_points_that_move_outside_the_fence_are_refused_in_a_word_now_and_then() -> None:
    rig, client = flying()
    rig.station.parameters.set("GF_MAX_HOR_DIST", 500.0)
    before = len(client.texts())
    for metres in range(100):
        client.send(local_setpoint(600 + metres, 0, -5))
        rig.run(0.1)
    assert 4 <= len(client.texts()) - before <= 6  # one in TEXT_PAUSE


@pytest.mark.parametrize(("frame", "turned"), [(7, False), (8, True), (9, True), (12, True)])
def test_a_position_in_an_offset_frame_counts_from_where_its_first_message_came(
    frame: int, turned: bool
) -> None:
    rig, client = flying()
    stream(rig, client, local_setpoint(0, 0, -5), 0.3)
    client.command(176, 1, 6, 0)
    stream(rig, client, local_setpoint(0, 0, -5, yaw=0.5), 6.0)
    place = rig.view.position
    yaw = math.pi / 2 - 0.5
    for _ in range(2):  # repeated, it is the same point; another offset begins anew
        stream(rig, client, local_setpoint(4, 0, -1, frame=frame, yaw=0.5), 8.0)
        forward = (math.cos(yaw), math.sin(yaw)) if turned else (0.0, 1.0)
        expected = (place[0] + 4 * forward[0], place[1] + 4 * forward[1], place[2] + 1)
        assert rig.view.position == pytest.approx(expected, abs=0.05)
        stream(rig, client, local_setpoint(0, 0, 0, frame=frame, yaw=0.5), 0.2)
        place = rig.view.position


def test_an_acceleration_alone_drives_the_velocity_up_to_the_limit() -> None:
    rig, client = flying()
    message = local_setpoint(0, 0, 0, mask=0b110000111111, afx=1.0)
    stream(rig, client, message, 0.3)
    assert client.command(176, 1, 6, 0).result == ACCEPTED
    stream(rig, client, message, 2.0)
    assert isinstance(rig.target, Follow)
    assert rig.target.velocity == pytest.approx((0.0, 2.0, 0.0), abs=0.15)  # 1 m/s² north for 2 s
    assert rig.target.acceleration == pytest.approx((0.0, 1.0, 0.0))
    stream(rig, client, message, 8.0)
    assert rig.target.velocity[1] == pytest.approx(6.0)  # MPC_XY_VEL_MAX
    back = local_setpoint(0, 0, 0, mask=0b110000111111, afx=-1.0)
    stream(rig, client, back, 1.0)
    assert rig.target.velocity[1] == pytest.approx(5.0, abs=0.15)  # it was not wound up


def test_a_yaw_rate_alone_turns_where_the_vehicle_is() -> None:
    rig, client = flying()
    rig.run(3.0)
    place = rig.view.position
    message = local_setpoint(0, 0, 0, mask=0b010111111111, yaw_rate=0.3)
    stream(rig, client, message, 0.3)
    assert client.command(176, 1, 6, 0).result == ACCEPTED
    stream(rig, client, message, 3.0)
    assert isinstance(rig.target, Follow)
    assert rig.target.yaw_rate == pytest.approx(-0.3)
    assert rig.target.velocity == (0.0, 0.0, 0.0)
    assert rig.view.position == pytest.approx(place, abs=0.01)


def test_one_client_at_a_time_has_offboard_control() -> None:
    rig, client = flying()
    other = rig.client(14540, link=1)
    stream(rig, client, local_setpoint(3, 2, -5), 0.3)
    client.command(176, 1, 6, 0)
    other.send(local_setpoint(-3, -2, -5))
    stream(rig, client, local_setpoint(3, 2, -5), 0.3)
    assert rig.target.position[:2] == pytest.approx((2, 3))
    assert "Another client" in other.texts()[-1]


def test_set_points_faster_than_the_envelope_are_limited() -> None:
    rig, client = flying()
    message = local_setpoint(0, 0, 0, mask=0b110111000111, vx=30.0, vy=40.0, vz=-50.0)
    stream(rig, client, message, 0.3)
    client.command(176, 1, 6, 0)
    stream(rig, client, message, 0.2)
    assert rig.target.velocity == pytest.approx((4.8, 3.6, 2.0))


def test_home_of_a_controller_that_starts_in_flight_is_on_the_ground() -> None:
    rig, _ = flying()
    again = Rig(dataclasses.replace(PROFILE, ground_height=-3.0), view=rig.view)
    again.station.machine.resume(again.view, again.now)
    x, y, _ = rig.view.position
    assert again.station.machine.home == (x, y, -3.0)


def test_the_profile_has_the_ground_of_the_description() -> None:
    vehicle = load_vehicle("iris", ("ground.height=12.5",))
    assert profile_of(vehicle).ground_height == 12.5


def test_a_controller_that_starts_in_flight_holds() -> None:
    rig, _ = flying()
    height, climb = rig.view.position[2], rig.view.velocity[2]
    again = Rig(view=rig.view)
    client = again.client()
    again.station.machine.resume(again.view, again.now)
    again.run(5.0)
    assert again.station.armed
    assert mode(again) == "HOLD"
    expected = height + stopping_distance(climb, 2.0)
    assert again.view.position[2] == pytest.approx(expected, abs=0.05)
    assert "Started in flight" in client.texts()[0]
    assert client.command(21).result == ACCEPTED
    again.run_until(lambda: not again.station.armed)
    assert again.view.vehicle_on_ground
