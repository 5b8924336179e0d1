"""Orbit, figure of eight and Follow Me: as commands, and flown on the real plant with the load."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.motion.patterns import LARGEST_ACCELERATION
from controller.ground.link.packing import FigureEightStatus
from tests.controller.ground.flown import Flown
from tests.controller.ground.in_flight import ACCEPTED, DENIED, REJECTED, flying, mode, set_parameter
from tests.controller.ground.kinematic import ZURICH
from tests.controller.ground.rig import NAN, Client, Rig

ORBIT: int = mavlink.MAV_CMD_DO_ORBIT
FIGURE_EIGHT: int = mavlink.MAV_CMD_DO_FIGURE_EIGHT
UNSET = 0x7FFFFFFF
CENTRE = (round(ZURICH[0] * 1e7), round(ZURICH[1] * 1e7))


def orbit(
    client: Client, radius: float = 5.0, speed: float = 2.0, yaw: float = 0.0, turn: float = 0.0
) -> Any:
    """MAVSDK's do_orbit: COMMAND_INT with an altitude above mean sea level."""
    return client.command_int(ORBIT, (radius, speed, yaw, turn), *CENTRE, 488.0 + 6.0)


def test_an_orbit_is_flown_and_reported() -> None:
    rig, client = flying()
    assert orbit(client).result == ACCEPTED
    assert rig.station.machine.mode.custom_mode == 3 << 16 | 1 << 24
    rig.run(8.0)
    status = client.got("ORBIT_EXECUTION_STATUS")[-1]
    assert status.radius == pytest.approx(5.0)
    assert (status.x, status.y) == pytest.approx(CENTRE, abs=2)
    assert status.z == pytest.approx(494.0, abs=0.01)
    assert math.hypot(*rig.view.position[:2]) == pytest.approx(5.0, abs=0.3)
    assert client.command(176, 1, 4, 3).result == ACCEPTED  # MAVSDK's hold
    rig.run(0.6)
    client.clear()
    rig.run(2.0)
    assert client.got("ORBIT_EXECUTION_STATUS") == []


@pytest.mark.parametrize(("frame", "altitude"), [(0, 494.0), (3, 494.0), (3, 6.0), (6, 494.0)])
def test_the_altitude_of_an_orbit_may_be_above_mean_sea_level_in_any_frame(
    frame: int, altitude: float
) -> None:
    """MAVSDK's do_orbit sends it so with frame 3, and PX4 reads it so."""
    rig, client = flying()
    assert client.command_int(ORBIT, (5.0, 2.0, 0.0, NAN), *CENTRE, altitude, frame).result == ACCEPTED
    pattern = rig.station.machine.pattern
    assert pattern is not None
    assert pattern.centre[2] == pytest.approx(6.0, abs=0.15)


def test_an_orbit_ends_after_the_turns_that_were_asked_for() -> None:
    rig, client = flying()
    assert orbit(client, 3.0, 2.0, turn=2 * math.pi).result == ACCEPTED
    rig.run_until(lambda: mode(rig) == "HOLD")
    assert "Orbit finished; holding" in client.texts()


def test_what_is_not_said_is_as_it_is() -> None:
    rig, client = flying()
    place = rig.view.position
    assert client.command_int(ORBIT, (NAN, NAN, NAN, NAN), UNSET, UNSET, NAN).result == ACCEPTED
    pattern = rig.station.machine.pattern
    assert pattern is not None
    assert pattern.centre == pytest.approx(place, abs=0.1)


def test_an_orbit_during_take_off_waits_for_its_end() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    client.command(400, 1)
    client.command(22)
    assert orbit(client).result == ACCEPTED
    load = rig.view.load_position
    rig.run_until(lambda: rig.view.load_position[2] > 0.3)
    assert math.dist(rig.view.load_position[:2], load[:2]) < 0.05
    rig.run(10.0)
    assert math.hypot(*rig.view.position[:2]) == pytest.approx(5.0, abs=0.3)


@pytest.mark.parametrize(
    ("params", "place", "words"),
    [
        ((5.0, 2.0, 9.0, 0.0), (*CENTRE, 494.0), "see DO_ORBIT"),
        ((0.0, 2.0, 0.0, 0.0), (*CENTRE, 494.0), "see DO_ORBIT"),
        ((5.0, math.inf, 0.0, 0.0), (*CENTRE, 494.0), "infinite"),
        ((5.0, 2.0, 0.0, 0.0), (CENTRE[0], UNSET, 494.0), "both or neither"),
        ((5.0, 2.0, 0.0, 0.0), (950_000_000, CENTRE[1], 494.0), "valid position"),
        ((900.0, 2.0, 0.0, 0.0), (*CENTRE, 494.0), "geofence"),
    ],
)
def test_what_is_no_orbit_is_denied(params: Any, place: Any, words: str) -> None:
    rig, client = flying()
    rig.station.parameters.set("GF_MAX_HOR_DIST", 500.0)
    assert client.command_int(ORBIT, params, *place).result == DENIED
    assert words in client.texts()[-1]


def test_on_the_ground_there_is_no_orbit() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert orbit(client).result == REJECTED
    assert "take off first" in client.texts()[-1]


def test_a_fast_orbit_is_as_fast_as_its_radius_allows_and_says_so() -> None:
    rig, client = flying()
    assert orbit(client, 2.0, 8.0).result == ACCEPTED
    pattern: Any = rig.station.machine.pattern
    assert pattern.speed == pytest.approx(math.sqrt(LARGEST_ACCELERATION * 2.0))
    assert "Orbit limited to 2.0 m/s" in client.texts()


def test_a_figure_of_eight_is_flown_in_hold_and_reported() -> None:
    rig, client = flying()
    ack = client.command_int(FIGURE_EIGHT, (8.0, 3.0, 0.0, math.radians(90)), *CENTRE, 494.0)
    assert ack.result == ACCEPTED
    assert mode(rig) == "HOLD"
    track = []
    for _ in range(600):
        rig.run(0.1)
        track.append(rig.view.position)
    east, north, _ = np.array(track[100:]).T
    assert np.abs(east).max() == pytest.approx(8.0, abs=0.4)  # its length lies east and west
    assert np.abs(north).max() == pytest.approx(3.0, abs=0.4)
    status = next(raw for raw in client.raw if raw[7] | raw[8] << 8 == FigureEightStatus.id)
    numbers = np.frombuffer(status[10 + 8 : 10 + 20], "<f4")
    assert numbers == pytest.approx((8.0, 3.0, math.pi / 2))


def target_message(x: float, y: float, altitude: float = 488.0, velocity: Any = (0.0, 0.0, 0.0)) -> Any:
    """FOLLOW_TARGET of somebody at x, y (m east, north)."""
    lat = ZURICH[0] + y / 111_200.0
    lon = ZURICH[1] + x / (111_200.0 * math.cos(math.radians(ZURICH[0])))
    zeros = [0.0] * 3
    return mavlink.MAVLink_follow_target_message(
        0, 3, round(lat * 1e7), round(lon * 1e7), altitude, velocity, zeros, [1, 0, 0, 0], zeros, zeros, 0
    )


def test_follow_me_keeps_its_distance_behind_somebody_who_walks() -> None:
    rig, client = flying()
    set_parameter(rig, client, "FLW_TGT_DST", 4.0)
    client.send(target_message(0.0, 0.0))
    assert client.command(176, 1, 4, 8).result == ACCEPTED
    for second in range(30):
        client.send(target_message(0.0, 1.0 * second, velocity=(1.0, 0.0, 0.0)))
        rig.run(1.0)
    assert rig.view.position == pytest.approx((0.0, 30.0 - 4.0, 8.0 + 0.1), abs=0.5)
    assert not any("follow" in text for text in client.texts())
    rig.run(20.0)  # silence: it stands
    assert any("Nobody to follow" in text for text in client.texts())
    assert math.hypot(*rig.view.velocity) < 0.01
    assert client.command(176, 1, 4, 3).result == ACCEPTED


def test_follow_me_without_anybody_holds_and_says_so() -> None:
    rig, client = flying()
    rig.run(3.0)
    place = rig.view.position
    assert client.command(176, 1, 4, 8).result == ACCEPTED
    rig.run(5.0)
    assert any("Nobody to follow" in text for text in client.texts())
    assert rig.view.position == pytest.approx(place, abs=0.3)


def test_a_height_above_a_target_below_home_is_as_low_as_the_load_allows() -> None:
    """MAVSDK-Python's examples/follow_me_example.py: 8 m above a target 8 m below home."""
    rig, client = flying()
    set_parameter(rig, client, "FLW_TGT_ALT_M", 2)
    client.send(target_message(0.0, 0.0, 480.0))
    client.command(176, 1, 4, 8)
    for _ in range(10):
        client.send(target_message(0.0, 0.0, 480.0))
        rig.run(1.0)
    fence = rig.station.machine.fence
    assert fence is not None
    assert rig.view.position[2] == pytest.approx(fence.home[2] + fence.least_height, abs=0.05)
    assert any("goes down too far" in text for text in client.texts())


@pytest.mark.parametrize(("radius", "speed"), [(6.0, 2.0), (-4.0, 2.0)])
def test_on_the_real_plant_the_vehicle_keeps_the_circle_and_the_load_swings_out_as_a_pendulum(
    radius: float, speed: float
) -> None:
    flown = Flown()
    client = flown.client()
    flown.take_off(client)
    assert orbit(client, radius, speed).result == ACCEPTED
    flown.run(35.0)
    track = flown.flown(12.0)
    size = abs(radius)
    distance = np.hypot(*track.vehicle[:, :2].T)
    print(f"vehicle {distance.min():.3f} to {distance.max():.3f} m")
    assert np.abs(distance - size).max() < 0.03 * size
    rate = speed / size
    vehicle = flown.vehicle
    pendulum = size / (1.0 - rate**2 * vehicle.hover_length / vehicle.gravity)
    load = np.hypot(*track.load[:, :2].T)
    assert load.mean() == pytest.approx(pendulum, rel=0.03)
    phase = np.unwrap(np.arctan2(track.vehicle[:, 1], track.vehicle[:, 0]))
    turned = (phase[-1] - phase[0]) / (track.time[-1] - track.time[0])
    assert turned == pytest.approx(-math.copysign(rate, radius), rel=0.02)
    view = flown.station.machine.view
    assert view is not None
    w, x, y, z = view.attitude
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    to_centre = math.atan2(-view.position[1], -view.position[0])
    assert abs(math.remainder(yaw - to_centre, 2 * math.pi)) < math.radians(5.0)
