"""Guidance on the real plant: what clients ask for is flown, and nothing that they ask for upsets it."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.link.packing import frame
from controller.pilot.guided.redesign import WEIGHTS
from sitl_bridge.mavlink.framing import Frame, split
from tests.controller.ground.flown import RATE_HZ, Flown
from tests.controller.ground.rig import NAN, Client
from tests.loopback import swing

LOAD = (101, 35)
NO_YAW = mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE | mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
SIZE, PERIOD, HEIGHT = 3.0, 15.0, 4.0
"""m, s, m"""


def eight(t: float) -> tuple[list[float], list[float], list[float]]:
    """Position, velocity, acceleration (NED) of a figure eight, at time t (s)."""
    w = 2.0 * math.pi / PERIOD
    north, east = SIZE * math.sin(w * t), 0.5 * SIZE * math.sin(2.0 * w * t)
    velocity = [SIZE * w * math.cos(w * t), SIZE * w * math.cos(2.0 * w * t), 0.0]
    return [north, east, -HEIGHT], velocity, [-w * w * north, -4.0 * w * w * east, 0.0]


def setpoint(client: Client, *numbers: float, target: tuple[int, int] = LOAD) -> None:
    client.send(
        mavlink.MAVLink_set_position_target_local_ned_message(0, *target, 1, NO_YAW, *numbers, 0.0, 0.0)
    )


def set_parameter(client: Client, name: str, value: float) -> None:
    client.send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32))


def flying() -> tuple[Flown, Client]:
    flight = Flown()
    client = flight.client()
    flight.take_off(client)
    return flight, client


def test_the_load_flies_a_figure_eight() -> None:
    """Joined while it is under way, at 1.8 m/s, and followed from there on without a lag."""
    flight, client = flying()
    began = flight.now

    def at_20_hz() -> None:
        if round((flight.now - began) * 250.0) % 12 == 0:
            position, velocity, acceleration = eight(flight.now - began)
            setpoint(client, *position, *velocity, *acceleration)

    flight.every_tick = at_20_hz
    flight.run(0.2)
    assert client.command(176, 1, 6, 0).result == 0
    flight.run(PERIOD)
    flight.run(PERIOD)
    assert flight.station.machine.mode.name == "OFFBOARD", client.texts()
    flown = flight.flown(PERIOD)
    wanted = np.array([eight(t - flown.time[-1] + flight.now - began)[0] for t in flown.time])
    away = np.linalg.norm(flown.load - wanted[:, (1, 0, 2)] * (1.0, 1.0, -1.0), axis=1)
    assert away.max() < 0.1
    # The path's own acceleration, 4 w² SIZE / 2 at most, swings the load by its share of gravity.
    own = math.degrees(math.atan(4.0 * (2.0 * math.pi / PERIOD) ** 2 * 0.5 * SIZE / 9.81))
    assert swing.swing(flown).max() < own + 2.0


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_set_points_at_random_do_not_upset_it(seed: int) -> None:
    flight, client = flying()
    chance = random.Random(seed)
    setpoint(client, 0.0, 0.0, -5.0, *[NAN] * 6)
    flight.run(0.1)
    assert client.command(176, 1, 6, 0).result == 0
    for _ in range(40):
        position = [chance.uniform(-20, 20), chance.uniform(-20, 20), chance.uniform(-15, -3)]
        velocity, acceleration = (
            [reach * chance.uniform(-1, 1) for _ in range(3)] if chance.random() < 0.7 else [NAN] * 3
            for reach in (10.0, 20.0)
        )
        setpoint(client, *position, *velocity, *acceleration, target=chance.choice([LOAD, (1, 1)]))
        flight.run(chance.choice([0.02, 0.05, 0.4, 0.9]))
    assert flight.station.machine.mode.name == "OFFBOARD", client.texts()


@pytest.mark.parametrize("down", [0.4, 1.5])
def test_a_velocity_downwards_ends_above_the_ground(down: float) -> None:
    flight, client = flying()
    clearance = flight.station.parameters["LND_CLEARANCE"]

    def at_20_hz() -> None:
        if round(flight.now * 250.0) % 12 == 0:
            setpoint(client, NAN, NAN, NAN, 0.5, 0.0, down, *[NAN] * 3, target=(1, 1))

    flight.run(2.0)
    command = mavlink.MAVLink_command_long_message(1, 1, 192, 0, -1, 1, 0, NAN, NAN, NAN, 488.0 + 5.0)
    assert client.ask(command).result == 0
    flight.run(5.0)
    flight.every_tick = at_20_hz
    flight.run(0.2)
    assert client.command(176, 1, 6, 0).result == 0
    flight.run(12.0)
    assert flight.station.machine.mode.name == "OFFBOARD", client.texts()
    told = [text for text in client.texts() if "down too far" in text]
    assert len(told) == 1
    end = flight.flown(3.0)
    assert flight.flown(12.0).load[:, 2].min() > 0.8 * clearance
    assert end.load[-1, 2] < 1.3 * clearance
    assert np.ptp(end.load[:, 1]) > 1.0  # north, as asked


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_velocities_at_random_keep_the_load_off_the_ground(seed: int) -> None:
    flight, client = flying()
    chance = random.Random(seed)
    setpoint(client, NAN, NAN, NAN, 0.0, 0.0, 0.0, *[NAN] * 3, target=(1, 1))
    flight.run(0.1)
    assert client.command(176, 1, 6, 0).result == 0
    for _ in range(40):
        velocity = [chance.uniform(-2, 2), chance.uniform(-2, 2), chance.uniform(-1, 3)]
        setpoint(client, NAN, NAN, NAN, *velocity, *[NAN] * 3, target=chance.choice([LOAD, (1, 1)]))
        flight.run(chance.choice([0.02, 0.05, 0.4, 0.9]))
    assert flight.station.machine.mode.name == "OFFBOARD", client.texts()
    assert flight.flown(10.0).load[:, 2].min() > 0.5 * flight.station.parameters["LND_CLEARANCE"]


@pytest.mark.parametrize("released", [False, True])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_set_points_whose_parts_contradict_each_other_keep_it_off_the_ground(
    seed: int, released: bool
) -> None:
    flight, client = flying()
    chance = random.Random(seed)
    if released:
        assert client.command(211, 1, 0).result == 0
        flight.run(3.0)
    setpoint(client, NAN, NAN, NAN, 0.0, 0.0, 0.0, *[NAN] * 3, target=(1, 1))
    flight.run(0.1)
    assert client.command(176, 1, 6, 0).result == 0
    for _ in range(25):
        numbers = [
            reach * chance.uniform(-1, 1) if chance.random() < 0.7 else NAN
            for reach in (20.0, 20.0, 8.0, 10.0, 10.0, 10.0, 5.0, 5.0, 5.0)
        ]
        for _ in range(chance.randrange(1, 20)):
            setpoint(client, *numbers, target=chance.choice([LOAD, (1, 1)]))
            flight.run(0.1)
    assert flight.station.machine.mode.name == "OFFBOARD", client.texts()
    way = flight.flown(20.0)
    lowest = (way.vehicle if released else way.load)[:, 2].min()
    assert lowest > 0.5 * flight.station.parameters["LND_CLEARANCE"]


@pytest.mark.parametrize("factor", [1e-3, 0.1, 10.0, 1e3])
def test_whatever_weights_are_set_in_flight_it_goes_on_flying(factor: float) -> None:
    """Weights whose gains do not carry the vehicle are refused with a reason."""
    flight, client = flying()
    for name in sorted(WEIGHTS):
        set_parameter(client, name, factor)
        flight.run(1.5)
        set_parameter(client, name, 1.0)
        flight.run(1.5)
        assert flight.station.machine.mode.name == "HOLD", (name, client.texts())
        assert np.ptp(flight.flown(1.0).load, axis=0).max() < 0.1, name


def test_weights_change_without_a_jolt_while_the_wind_pushes() -> None:
    """The integral holds against the wind; with ten times its weight it does so with another number."""
    flight = Flown("air.wind=[6.0, 2.0, 0.0]")
    client = flight.client()
    flight.take_off(client)
    flight.run(25.0)
    for name, factor in (("LQR_Q_INT", 10.0), ("LQR_R_MOMENT", 5.0), ("LQR_Q_ATT", 0.2)):
        set_parameter(client, name, factor)
        flight.run(3.0)
        assert "New weights in use" in client.texts()[-1]
        assert np.ptp(flight.flown(3.0).load, axis=0).max() < 0.02, name


def frame_of(number: int, payload: bytes, system: int) -> Frame:
    """A frame with a good checksum around any payload."""
    raw = frame(payload, number, mavlink.mavlink_map[number].crc_extra, 0, system, 35, False)
    return split(raw).frames[0]


def test_nothing_that_the_plant_says_raises() -> None:
    flight, _ = flying()
    chance = random.Random(1)
    for number in (mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, *sorted(mavlink.mavlink_map)):
        for system in (1, 101, 7):
            payload = chance.randbytes(chance.randrange(1, 255))
            flight.pilot.hear(frame_of(number, payload, system), flight.now)
    flight.run(1.0)
    assert flight.station.machine.mode.name in ("HOLD", "RTL", "LAND")  # a battery at any charge may be told


def test_the_plants_battery_brings_it_home() -> None:
    """BATTERY_STATUS on the HIL link: a warning, then return when critical, land in an emergency."""
    flight = Flown("battery.capacity=0.2")
    client = flight.client()
    flight.take_off(client)
    flight.run_until(lambda: flight.station.machine.mode.name == "RTL")
    assert any("low, warning only" in text for text in client.texts())
    assert any("critical, returning" in text for text in client.texts())
    flight.run_until(lambda: not flight.station.armed)
    remaining = [m.battery_remaining for m in client.got("BATTERY_STATUS")][1:]  # the first: unknown
    assert remaining == sorted(remaining, reverse=True)
    assert remaining[-1] < 8
    assert client.command(400, 1).result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    assert "COM_ARM_BAT_MIN" in client.texts()[-1]


def test_it_flies_on_when_the_cable_snaps() -> None:
    flight, client = flying()
    flight.run(1.0)
    flight.simulation.world.release_cable()
    flight.run(8.0)
    assert any("The load is lost" in text for text in client.texts())
    assert flight.station.machine.mode.name == "HOLD", client.texts()
    still = flight.flown(1.0)
    assert np.ptp(still.vehicle, axis=0).max() < 0.1
    assert client.command(21).result == 0
    flight.run_until(lambda: not flight.station.armed)
    assert flight.flown(0.1).vehicle[-1, 2] < 0.15


def test_a_plant_that_is_paused_for_a_minute_is_not_lost() -> None:
    rig = Flown()
    client = rig.client()
    rig.take_off(client)
    rig.run(1.0)
    mode, ticks = rig.station.machine.mode, rig.simulation.ticks_flown
    rig.clock.change_speed(0.0, rig.now)
    for _ in range(round(60.0 * RATE_HZ)):
        rig.tick()
        rig.pilot.wait(rig.now)
    assert rig.simulation.ticks_flown <= ticks + 1
    rig.clock.change_speed(None, rig.now)
    rig.run(1.0)
    assert rig.simulation.ticks_flown >= ticks + RATE_HZ
    assert (rig.station.machine.mode, rig.station.armed) == (mode, True)
    assert not [text for text in client.texts() if "lost" in text]
