"""Modes, preconditions and failsafes, flown with the kinematic vehicle."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.targets import Body, Follow, Goto, Idle, Land, Terminate
from controller.ground.view import Profile
from controller.trajectory import stopping_distance
from sitl_bridge.frames import LocalOrigin, quaternion_from_euler
from tests.ground.kinematic import PROFILE, ZURICH, grounded_view
from tests.ground.rig import NAN, Client, Rig

ACCEPTED, REJECTED, DENIED = 0, 1, 2
HOME_HEIGHT = 0.1


def flying() -> tuple[Rig, Client]:
    rig = Rig()
    client = rig.client()
    rig.fly(client)
    return rig, client


def mode(rig: Rig) -> str:
    return rig.station.machine.mode.name


def local_setpoint(x: float, y: float, z: float, mask: int = 2552, frame: int = 1, **fields: float) -> Any:
    values = {
        "vx": 0.0,
        "vy": 0.0,
        "vz": 0.0,
        "afx": 0.0,
        "afy": 0.0,
        "afz": 0.0,
        "yaw": 0.0,
        "yaw_rate": 0.0,
    }
    values.update(fields)
    target = (int(values.pop("system", 1)), int(values.pop("component", 1)))
    return mavlink.MAVLink_set_position_target_local_ned_message(0, *target, frame, mask, x, y, z, **values)


def stream(rig: Rig, client: Client, message: Any, seconds: float) -> None:
    for _ in range(round(seconds / 0.1)):
        client.send(message)
        rig.run(0.1)


# Arming


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


# Take-off and landing


@pytest.mark.parametrize("arm_first", [True, False])
def test_take_off_in_both_orders(arm_first: bool) -> None:
    """MAVSDK arms first; QGroundControl takes off (p7 above mean sea level) and arms then."""
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    commands = [(400, (1.0,)), (22, (NAN,) * 6 + (488.0 + HOME_HEIGHT + 4.0,))]
    for number, params in commands if arm_first else reversed(commands):
        assert client.command(number, *params).result == ACCEPTED
    steps = []
    while mode(rig) == "TAKEOFF" or not steps:
        rig.run(0.02)
        steps.append(rig.target)
        assert len(steps) < 3000
    bodies = [s.body for s in steps if isinstance(s, Goto)]
    assert bodies[0] is Body.VEHICLE
    assert bodies[-1] is Body.LOAD
    assert bodies == sorted(bodies, key=lambda b: b is Body.LOAD)  # goes over once
    rig.run(5.0)
    assert mode(rig) == "HOLD"
    assert rig.view.position[2] == pytest.approx(4.0 + HOME_HEIGHT, abs=0.25)
    assert not rig.view.load_on_ground


def test_the_cable_stays_slack_until_the_vehicle_is_above_the_load() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    client.command(400, 1)
    client.command(22)
    start = rig.view.load_position
    rig.run_until(lambda: rig.view.cable_taut)
    assert math.dist(start, rig.view.load_position) < 0.02
    assert math.hypot(rig.view.position[0] - start[0], rig.view.position[1] - start[1]) < 0.3


def test_a_take_off_too_low_for_the_load_goes_higher_and_says_so() -> None:
    rig = Rig()
    client = rig.client()
    client.send(mavlink.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 1.0, 9))
    rig.fly(client)
    rig.run(3.0)
    assert rig.view.load_position[2] > 0.4
    assert any("so that the load leaves the ground" in text for text in client.texts())


@pytest.mark.parametrize("altitude", [math.inf, 100.0, 488.0, 5000.0])
def test_take_off_to_nowhere_is_refused(altitude: float) -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(22, *(NAN,) * 6, altitude).result == DENIED
    assert "Take-off refused" in client.texts()[-1]


@pytest.mark.parametrize(("number", "params"), [(176, (1, 4, 6)), (21, ()), (176, (1, 4, 5)), (20, ())])
def test_land_and_return_set_the_load_down_first(number: int, params: tuple[float, ...]) -> None:
    rig, client = flying()
    assert client.command(number, *params).result == ACCEPTED
    rig.run_until(lambda: rig.view.load_on_ground)
    assert not rig.view.vehicle_on_ground
    down = rig.view.load_position
    rig.run_until(lambda: not rig.station.armed)
    assert rig.view.vehicle_on_ground
    apart = math.hypot(rig.view.position[0] - down[0], rig.view.position[1] - down[1])
    assert 0.3 < apart <= 0.6 * PROFILE.rest_length + 0.2
    assert math.dist(down, rig.view.load_position) < 0.05
    assert "Disarmed" in client.texts()[-1]


def test_return_climbs_and_brings_the_load_home() -> None:
    rig, client = flying()
    start = (1.0, 0.0)  # where the load lay
    assert (
        client.command(192, -1, 1, 0, NAN, ZURICH[0] + 2e-4, ZURICH[1] + 2e-4, 488 + 3.0).result == ACCEPTED
    )
    rig.run_until(lambda: rig.view.position[1] > 20)
    assert client.command(20).result == ACCEPTED
    highest = 0.0
    while rig.station.armed:
        rig.run(0.02)
        highest = max(highest, rig.view.position[2])
    assert highest == pytest.approx(6.0 + HOME_HEIGHT, abs=0.6)
    assert math.dist(rig.view.load_position[:2], start) < 0.5


def test_a_landing_is_broken_off_by_hold() -> None:
    rig, client = flying()
    client.command(21)
    rig.run(0.5)
    assert client.command(176, 1, 4, 3).result == ACCEPTED
    rig.run(1.0)
    height = rig.view.position[2]
    rig.run(5.0)
    assert rig.view.position[2] == pytest.approx(height, abs=0.05)
    assert mode(rig) == "HOLD"


# Going to a point


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
        ((-1, 1, 0, NAN, 91.0, 8.0, 492.0), "no place"),
        ((-1, 1, 0, NAN, ZURICH[0], NAN, 492.0), "both or neither"),
        ((-1, 1, 0, NAN, ZURICH[0] + 1, ZURICH[1], 492.0), "GF_MAX_HOR_DIST"),
        ((-1, 1, 0, NAN, ZURICH[0], ZURICH[1], 800.0), "GF_MAX_VER_DIST"),
        ((-1, 1, 0, NAN, ZURICH[0], ZURICH[1], 489.0), "too low"),
        ((-1, 1, 0, NAN, ZURICH[0], ZURICH[1], math.inf), "infinite"),
        ((-1, 1, 0, math.inf, ZURICH[0], ZURICH[1], 492.0), "infinite"),
    ],
)
def test_points_that_cannot_be_flown_to_are_refused(params: tuple[float, ...], words: str) -> None:
    rig, client = flying()
    target = rig.station.update(rig.view, rig.now)
    assert client.command(192, *params).result == DENIED
    assert words in client.texts()[-1]
    assert rig.station.update(rig.view, rig.now) is target


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


# Offboard


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
        (local_setpoint(0, 0, -5, mask=0b111111111111), "without position or velocity"),
        (local_setpoint(0, 0, -5, mask=0b110000111111, afx=1.0), "without position or velocity"),
        (local_setpoint(math.inf, 0, -5), "beyond all bounds"),
        (local_setpoint(0, 0, -5, frame=9), "body's frame|frame 9"),
        (local_setpoint(9000, 0, -5), "GF_MAX_HOR_DIST"),
        (local_setpoint(0, 0, -0.5), "too low"),
        (mavlink.MAVLink_set_attitude_target_message(0, 1, 1, 0, [1, 0, 0, 0], 0, 0, 0, 0.5), "Attitude"),
    ],
)
def test_set_points_that_cannot_be_flown_are_refused_and_do_not_count(message: Any, words: str) -> None:
    rig, client = flying()
    stream(rig, client, message, 0.5)
    assert any(word in client.texts()[-1] for word in words.split("|"))
    assert client.command(176, 1, 6, 0).result == REJECTED


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


# Failsafes


def set_parameter(rig: Rig, client: Client, name: str, value: float) -> None:
    assert rig.station.parameters.set(name, value) == ""


@pytest.mark.parametrize(("action", "expected"), [(5, "HOLD"), (3, "RTL"), (4, "LAND"), (6, "TERMINATION")])
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


@pytest.mark.parametrize(
    ("action", "expected"), [(0, "HOLD"), (1, "HOLD"), (2, "RTL"), (3, "LAND"), (5, "TERMINATION")]
)
def test_ground_station_lost(action: int, expected: str) -> None:
    rig = Rig()
    client = rig.client()
    client.heartbeat()
    rig.fly(client)
    set_parameter(rig, client, "NAV_DLL_ACT", action)
    for _ in range(20):
        client.heartbeat()
        rig.run(1.0)
    assert mode(rig) == "HOLD"
    rig.run(10.5)
    assert mode(rig) == expected
    assert any("No ground station" in text for text in client.texts()) == (action != 0)


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
    assert client.got("HEARTBEAT")[-1].system_status in (
        mavlink.MAV_STATE_EMERGENCY,
        mavlink.MAV_STATE_CRITICAL,
    )


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
    from tests.ground.test_missions import SQUARE, Uploader

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


# The end


def test_disarming_in_flight_needs_force() -> None:
    rig, client = flying()
    assert client.command(400, 0).result == DENIED
    assert "21196" in client.texts()[-1]
    assert rig.station.armed
    assert client.command(400, 0, 21196).result == ACCEPTED
    assert rig.target == Idle(False)


def test_termination_is_for_good() -> None:
    rig, client = flying()
    assert client.command(185, 0).result == DENIED
    assert client.command(185, 1).result == ACCEPTED
    assert rig.target == Terminate()
    rig.run(1.2)
    beat = [m for m in client.got("HEARTBEAT") if m.get_srcSystem() == 1][-1]
    assert beat.system_status == mavlink.MAV_STATE_FLIGHT_TERMINATION
    assert beat.custom_mode == 10 << 16
    assert client.command(176, 1, 4, 3).result == DENIED
    assert client.command(22).result == DENIED
    assert client.command(400, 0).result == ACCEPTED
    assert client.command(400, 1).result == ACCEPTED


def test_a_vehicle_without_ground_is_in_the_air_when_armed() -> None:
    profile = Profile("paper", 0, LocalOrigin(*ZURICH), 1.0, 1.981, False)
    view = dataclasses.replace(
        grounded_view(), position=(0.0, 0.0, 1.981), load_position=(0.0, 0.0, 0.0), cable_taut=True,
        vehicle_on_ground=False, load_on_ground=False,
    )  # fmt: skip
    rig = Rig(profile, view=view)
    client = rig.client()
    rig.frozen = True
    rig.run(0.1)
    assert client.command(400, 1).result == ACCEPTED
    assert rig.target == Goto(Body.LOAD, (0.0, 0.0, 0.0), pytest.approx(0.3), 3.0)
    assert client.command(21).result == DENIED
    assert "no ground" in client.texts()[-1]
    assert client.command(22).result == REJECTED
    assert client.command(192, -1, 1, 0, NAN, NAN, NAN, 487.0).result == ACCEPTED


def test_a_lost_load_leaves_the_vehicle_to_itself() -> None:
    rig, client = flying()
    rig.view.load_attached = False
    rig.view.cable_taut = False
    rig.run(0.1)
    assert rig.target.body is Body.VEHICLE
    assert client.command(21).result == ACCEPTED
    rig.run_until(lambda: isinstance(rig.target, Land))
    rig.run_until(lambda: not rig.station.armed)
