"""Attitude and body-rate set-points: protocol, and flown on the real plant with the load hanging."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.guidance import Stage
from controller.ground.flight.motion.setpoint_types import Attitude, Idle
from controller.ground.telemetry.plant_clock import PlantClock
from sitl_bridge.frames import (
    Triple,
    attitude_to_ned_frd,
    euler_from_quaternion,
    quaternion_from_euler,
    rotate,
    rotate_inverse,
)
from tests.controller.ground.flown import Flown
from tests.controller.ground.in_flight import ACCEPTED, REJECTED, flying, local_setpoint, mode, stream
from tests.controller.ground.rig import NAN, TICK, Client, Rig

ATTITUDE, RATES = 0b111, 0b10000000
"""Type masks of MAVSDK's set_attitude and set_attitude_rate"""
OFFBOARD = (176, 1, 6, 0)


def message(
    mask: int, euler: Triple = (0.0, 0.0, 0.0), rates: Triple = (0.0, 0.0, 0.0), thrust: float = 0.5
) -> Any:
    """SET_ATTITUDE_TARGET; euler: FRD in NED, rad."""
    q = quaternion_from_euler(euler)
    return mavlink.MAVLink_set_attitude_target_message(0, 1, 1, mask, q, *rates, thrust)


def test_an_attitude_is_flown_as_the_mask_says() -> None:
    rig, client = flying()
    stream(rig, client, message(ATTITUDE, (0.1, -0.2, 1.0), (9.0, 9.0, 9.0), 0.6), 0.3)
    assert client.command(*OFFBOARD).result == ACCEPTED
    stream(rig, client, message(ATTITUDE, (0.1, -0.2, 1.0), (9.0, 9.0, 9.0), 0.6), 0.3)
    target = rig.target
    assert isinstance(target, Attitude)
    assert target.attitude is not None
    euler = euler_from_quaternion(attitude_to_ned_frd(target.attitude))
    assert euler == pytest.approx((0.1, -0.2, 1.0), abs=1e-6)
    assert all(math.isnan(rate) for rate in target.body_rates)
    assert target.thrust == pytest.approx(0.6)
    stream(rig, client, message(RATES, rates=(0.1, 0.2, 0.3)), 0.1)
    target = rig.target
    assert isinstance(target, Attitude)
    assert target.attitude is None
    assert target.body_rates == pytest.approx((0.1, -0.2, -0.3))
    stream(rig, client, local_setpoint(0, 0, -4), 0.1)  # and back to positions, in the same mode
    assert not isinstance(rig.target, Attitude)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (message(ATTITUDE | 64), "without thrust"),
        (message(ATTITUDE, thrust=NAN), "without thrust"),
        (message(RATES | ATTITUDE), "neither attitude nor body rates"),
        (message(RATES, rates=(math.inf, 0.0, 0.0)), "beyond all bounds"),
        (mavlink.MAVLink_set_attitude_target_message(0, 1, 1, 7, [0, 0, 0, 0], 0, 0, 0, 0.5), "no attitude"),
        (mavlink.MAVLink_set_attitude_target_message(0, 1, 1, 7, [NAN] * 4, 0, 0, 0, 0.5), "no attitude"),
    ],
)
def test_what_cannot_be_flown_is_denied_and_does_not_count(asked: Any, words: str) -> None:
    rig, client = flying()
    stream(rig, client, asked, 0.3)
    assert words in client.texts()[-1]
    assert client.command(*OFFBOARD).result == REJECTED


def test_thrust_is_within_its_range() -> None:
    rig, client = flying()
    stream(rig, client, message(ATTITUDE, thrust=7.0), 0.3)
    client.command(*OFFBOARD)
    stream(rig, client, message(ATTITUDE, thrust=7.0), 0.1)
    assert rig.target.thrust == 1.0
    stream(rig, client, message(ATTITUDE, thrust=-0.5), 0.1)
    assert rig.target.thrust == 0.0


def test_on_the_ground_it_stands_until_there_is_thrust() -> None:
    """MAVSDK-Python's examples/offboard_attitude.py: thrust 0 first."""
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(400, 1).result == ACCEPTED
    stream(rig, client, message(ATTITUDE, thrust=0.0), 0.3)
    assert client.command(*OFFBOARD).result == ACCEPTED
    stream(rig, client, message(ATTITUDE, thrust=0.0), 1.0)
    assert rig.target == Idle(True)
    stream(rig, client, message(ATTITUDE, thrust=0.7), 0.1)
    assert isinstance(rig.target, Attitude)
    stream(rig, client, message(ATTITUDE, thrust=0.0), 0.1)  # the kinematic vehicle never left the ground
    assert rig.target == Idle(True)


def test_set_points_that_stop_are_a_failsafe() -> None:
    rig, client = flying()
    stream(rig, client, message(ATTITUDE), 0.3)
    client.command(*OFFBOARD)
    stream(rig, client, message(ATTITUDE), 0.5)
    rig.run(1.2)
    assert mode(rig) == "HOLD"
    assert any("No offboard set-point" in text for text in client.texts())


def test_the_load_has_no_attitude() -> None:
    rig, client = flying()
    client.send(mavlink.MAVLink_set_attitude_target_message(0, 101, 35, 7, [1, 0, 0, 0], 0, 0, 0, 0.5))
    rig.run(0.1)
    assert client.command(*OFFBOARD).result == REJECTED


def test_time_is_that_of_the_telemetry() -> None:
    rig, client = flying()
    client.send(mavlink.MAVLink_timesync_message(0, 12345))
    rig.run(0.02)
    (answer,) = client.got("TIMESYNC")
    assert answer.ts1 == 12345
    assert 0.0 <= rig.view.time - answer.tc1 * 1e-9 < 2.1 * TICK  # the view was moved on twice since


def test_time_goes_on_between_two_ticks_and_never_past_the_next() -> None:
    clock = PlantClock()
    assert clock.read(7.0) == 7.0  # before the first tick
    for tick in range(3):
        clock.note(100.0 + 0.004 * tick, 50.0 + 0.010 * tick)  # slower than real time
    readings = [clock.read(50.020 + step) for step in (0.0, 0.001, 0.003, 0.008)]
    assert readings == pytest.approx([100.008, 100.009, 100.011, 100.012])
    clock.note(100.012, 50.030)
    assert clock.read(50.030) >= readings[-1] - 1e-9


def test_odometry_and_attitude_at_100_hz_on_request() -> None:
    flown = Flown()
    client = flown.client()
    flown.run(0.3)
    for number in (331, 31):
        assert client.command(511, number, 10_000).result == ACCEPTED
    client.clear()
    flown.run(2.0)
    for name in ("ODOMETRY", "ATTITUDE_QUATERNION"):
        stamps = [getattr(m, "time_usec", 0) or 1000 * m.time_boot_ms for m in client.got(name)]
        assert len(stamps) == pytest.approx(200, abs=2)
        assert np.diff(stamps) == pytest.approx(10_000, abs=4_001)  # ticks of 4 ms


class Steered:
    """A client that streams attitude set-points at 50 Hz to a vehicle on the real plant."""

    def __init__(self, flown: Flown, client: Client) -> None:
        self.flown, self.client = flown, client
        self.asked: Any = None
        self._next = 0.0
        flown.every_tick = self._send

    def _send(self) -> None:
        if self.asked is not None and self.flown.now >= self._next:
            self._next = self.flown.now + 0.02
            self.client.send(self.asked)

    def offboard(self, first: Any) -> None:
        self.asked = first
        self.flown.run(0.3)
        assert self.client.command(*OFFBOARD).result == ACCEPTED, self.client.texts()

    @property
    def view(self) -> Any:
        view = self.flown.station.machine.view
        assert view is not None
        return view

    def euler(self) -> Triple:
        """Roll, pitch, yaw, FRD in NED, rad."""
        return euler_from_quaternion(attitude_to_ned_frd(self.view.attitude))


def steered(vehicle: str = "iris") -> Steered:
    flown = Flown(vehicle=vehicle)
    client = flown.client()
    flown.take_off(client)
    flown.run(3.0)
    return Steered(flown, client)


@pytest.mark.parametrize("vehicle", ["iris", "heavy"])
def test_hover_thrust_hovers_and_a_tilt_is_taken_with_a_small_lag(vehicle: str) -> None:
    it = steered(vehicle)
    hover = it.flown.station.parameters["MPC_THR_HOVER"]
    assert hover == pytest.approx(it.flown.profile.hover_thrust)
    heading = it.euler()[2]
    it.offboard(message(ATTITUDE, (0.0, 0.0, heading), thrust=hover))
    it.flown.run(2.0)
    assert abs(it.view.velocity[2]) < 0.1  # m/s: what is left is drag and the load's bounce
    assert it.euler()[:2] == pytest.approx((0.0, 0.0), abs=math.radians(1.0))
    # A roll of 10 degrees, with the thrust that carries the weight all the same.
    roll = math.radians(10.0)
    it.asked = message(ATTITUDE, (roll, 0.0, heading), thrust=hover / math.cos(roll))
    law = it.flown.pilot._laws._attitude_law[0]
    settle = 3.0 * (1.0 / law["rate_gain"][0] + 1.0 / law["attitude_gain"][0])
    it.flown.run(settle)
    assert it.euler()[0] == pytest.approx(roll, abs=math.radians(1.5))
    right = rotate((*_level(it.view.attitude),), (0.0, -1.0, 0.0))
    sideways = sum(a * b for a, b in zip(it.view.velocity, right, strict=True))
    assert sideways > 0.3 * settle * 9.81 * math.tan(roll) * 0.5


def _level(attitude: Any) -> Any:
    return quaternion_from_euler((0.0, 0.0, euler_from_quaternion(attitude)[2]))


def test_body_rates_are_held() -> None:
    it = steered()
    hover = it.flown.station.parameters["MPC_THR_HOVER"]
    it.offboard(message(RATES, thrust=hover))
    it.asked = message(RATES, rates=(0.0, 0.0, 0.8), thrust=hover)
    it.flown.run(2.0)
    assert it.view.body_rates[2] == pytest.approx(-0.8, abs=0.05)  # FRD's yaw is clockwise
    it.asked = message(RATES, rates=(0.3, 0.0, 0.0), thrust=hover)
    before = it.euler()[0]
    it.flown.run(0.5)
    assert it.view.body_rates[0] == pytest.approx(0.3, abs=0.06)
    assert 0.05 < it.euler()[0] - before < 0.17


def test_position_control_takes_over_without_a_jump_of_thrust_and_the_load_comes_to_rest() -> None:
    it = steered()
    hover = it.flown.station.parameters["MPC_THR_HOVER"]
    heading = it.euler()[2]
    it.offboard(message(ATTITUDE, (0.0, 0.0, heading), thrust=hover))
    it.flown.run(1.0)
    it.asked = message(ATTITUDE, (0.1, 0.0, heading), thrust=hover)
    it.flown.run(1.0)
    before = np.array(it.view.position), np.array(it.flown.pilot._laws._controls[:4])
    it.asked = None
    assert it.client.command(176, 1, 4, 3).result == ACCEPTED
    it.flown.run(0.02)
    after = np.array(it.flown.pilot._laws._controls[:4])
    assert np.abs(after - before[1]).max() < 0.1
    it.flown.run(8.0)
    assert np.linalg.norm(it.view.velocity) < 0.05
    assert np.linalg.norm(it.view.load_velocity) < 0.1
    assert np.linalg.norm(np.array(it.view.position) - before[0]) < 3.0


def test_from_the_ground_up_with_the_load_and_down_again() -> None:
    """The calls of MAVSDK-Python's examples/offboard_attitude.py."""
    flown = Flown()
    client = flown.client()
    flown.run(0.5)
    assert client.command(400, 1).result == ACCEPTED
    it = Steered(flown, client)
    it.offboard(message(ATTITUDE, thrust=0.0))
    for roll, thrust, seconds in ((0.0, 0.7, 2.0), (30.0, 0.6, 2.0), (-30.0, 0.6, 2.0), (0.0, 0.6, 2.0)):
        it.asked = message(ATTITUDE, (math.radians(roll), 0.0, 0.0), thrust=thrust)
        flown.run(seconds)
        assert flown.station.armed, client.texts()
    it.asked = None
    assert client.command(176, 1, 4, 3).result == ACCEPTED
    assert client.command(21).result == ACCEPTED
    flown.run_until(lambda: not flown.station.armed, 120.0)
    assert it.view.vehicle_on_ground
    assert "Landed" in client.texts()
    assert flown.station.machine.stage is Stage.GROUND


def test_the_tilt_comes_first_and_the_turn_about_it_follows() -> None:
    """The error of an attitude against quaternion algebra."""
    from controller.law.attitude_law import _attitude_error

    generator = np.random.default_rng(4)
    for _ in range(200):
        euler = generator.uniform((-3.0, -1.5, -3.0), (3.0, 1.5, 3.0))
        q = generator.normal(size=4)
        q /= np.linalg.norm(q)
        error = np.zeros(3)
        _attitude_error(*euler, q, error)
        ours, wanted = quaternion_from_euler(tuple(euler)), tuple(q)
        # Turning our axis by the tilt brings it onto the wanted one: both as seen in our body.
        axis = rotate_inverse(ours, rotate(wanted, (0.0, 0.0, 1.0)))
        angle = math.hypot(error[0], error[1])
        turned = (error[1] / angle * math.sin(angle), -error[0] / angle * math.sin(angle), math.cos(angle))
        assert turned == pytest.approx(axis, abs=1e-9)
        # And then by the heading: the whole is the wanted attitude.
        tilt = (math.cos(angle / 2), *(math.sin(angle / 2) * e / angle for e in (error[0], error[1])), 0.0)
        turn = (math.cos(error[2] / 2), 0.0, 0.0, math.sin(error[2] / 2))
        for unit in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)):
            whole = rotate(ours, rotate(tilt, rotate(turn, unit)))  # type: ignore[arg-type]
            assert whole == pytest.approx(rotate(wanted, unit), abs=1e-9)
