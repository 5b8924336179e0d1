"""Sources of the load's state: what they wait for, and a swinging load that they find with a sensor."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mavlink

from controller.law.state import LOAD_POSITION
from controller.over.ages import LONGEST_STANDSTILL
from controller.over.load.filtered import FilteredSource, Sensor, load_source
from controller.over.load.source import TruthSource
from controller.over.telemetry import ImuSample, Telemetry, VehicleState
from sitl_bridge.frames import LocalOrigin, flu_to_frd, rotate_inverse
from sitl_bridge.mavlink.framing import Packer, split
from sitl_bridge.plant.physics.state import SPECIFIC_FORCE
from sitl_bridge.plant.physics.world import World
from sitl_bridge.vehicle.files import load_vehicle

SWINGING = load_vehicle("iris", ["initial.start=hover", "initial.load_position=[0,0,20]"])
TRACKER, LOAD = Packer(1, 191), Packer(101, 35)
ORIGIN = LocalOrigin(47.397742, 8.545594, 488.0)


def sighting(time_s: float, offset: Any, attitude: Any) -> Any:
    x, y, z = flu_to_frd(rotate_inverse(attitude, tuple(offset)))
    return mavlink.MAVLink_landing_target_message(
        round(time_s * 1e6), 0, 12, 0, 0, 0, 0, 0, x, y, z, [1, 0, 0, 0], 0, 1
    )


def position(place: Any, velocity: Any) -> Any:
    point = ORIGIN.geodetic(tuple(place))
    east, north, up = (round(100 * v) for v in velocity)
    return mavlink.MAVLink_global_position_int_message(
        *(0, round(point.latitude * 1e7), round(point.longitude * 1e7), round(1000 * point.altitude), 0),
        *(north, east, -up, 0xFFFF),
    )


@pytest.mark.parametrize(
    ("sensor", "late", "allowed"), [(Sensor.TRACKER, 0.1, 0.04), (Sensor.POSITION, 0.0, 0.12)]
)
def test_a_swinging_load_is_found_with_a_sensor(sensor: Sensor, late: float, allowed: float) -> None:
    """10 Hz of noisy messages, a tracker's late by a tenth of a second; the accelerometer is not used."""
    world = World(SWINGING, 250.0, seed=0)
    world.state[16:19] = (1.0, -0.5, 0.0)
    world.command(world.trim_controls)
    source, telemetry = FilteredSource(SWINGING, sensor), Telemetry()
    telemetry.origin = ORIGIN
    noise = np.random.default_rng(1)
    messages: list[tuple[float, bytes]] = []
    errors = []
    for tick in range(2000):
        world.advance(world.steps_per_tick)
        if tick % 2:
            continue
        world.measure(tick, False)
        x, now = world.state.copy(), tick / 250.0
        place, velocity, attitude = (
            tuple(x[part].tolist()) for part in (slice(0, 3), slice(3, 6), slice(6, 10))
        )
        telemetry.vehicle = VehicleState(now, place, velocity, attitude, (0.0, 0.0, 0.0))
        telemetry.last_imu = ImuSample(now, tuple(world.reactions[SPECIFIC_FORCE].tolist()))
        if tick % 26 == 0:
            if sensor is Sensor.TRACKER:
                seen = x[13:16] - x[0:3] + noise.normal(0.0, 0.02, 3)
                messages.append((now + late, TRACKER.pack(sighting(now, seen, attitude))))
            else:
                where = x[13:16] + noise.normal(0.0, 0.1, 3)
                messages.append((now + late, LOAD.pack(position(where, x[16:19]))))
        while messages and messages[0][0] <= now:
            source.hear(split(messages.pop(0)[1]).frames[0], now)
        state = source.state(telemetry, now)
        assert state is not None
        errors.append(float(np.linalg.norm(state[LOAD_POSITION] - x[13:16])))
    assert max(errors[:200]) > 0.02
    assert np.mean(errors[500:]) < allowed


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("none", "HIGHRES_IMU"),
        ("tracker", "LANDING_TARGET"),
        ("position", "GLOBAL_POSITION_INT of component 35"),
        ("truth", "plant's ODOMETRY"),
    ],
)
def test_what_is_missing_is_named(kind: str, words: str) -> None:
    missing = load_source(kind, SWINGING).missing(Telemetry(), 0.0)
    assert missing is not None
    assert words in missing


@given(st.binary(max_size=300), st.sampled_from(["none", "tracker", "position", "truth"]))
def test_no_datagram_upsets_a_source(data: bytes, kind: str) -> None:
    source = load_source(kind, SWINGING)
    for frame in split(data).frames:
        source.hear(frame, 0.0)
    assert source.state(Telemetry(), 0.0) is None


def test_the_truth_ages_by_the_stacks_time() -> None:
    """A plant that stands still for a while has nothing new to say; one whose link is gone flies on."""
    source, telemetry = TruthSource(), Telemetry()
    world = World(SWINGING, 250.0, seed=0)
    zero, unknown = (0.0,) * 3, [math.nan] + [0.0] * 20
    at_rest = mavlink.MAVLink_odometry_message(0, 1, 12, *zero, [1, 0, 0, 0], *zero, *zero, unknown, unknown)
    for packer in (Packer(1, 191), LOAD):
        for frame in split(packer.pack(at_rest)).frames:
            source.hear(frame, 5.0)
    place = tuple(world.state[0:3].tolist())

    def missing(stack_time: float, now: float) -> str | None:
        telemetry.vehicle = VehicleState(stack_time, place, zero, (1.0, 0.0, 0.0, 0.0), zero)
        assert (source.state(telemetry, now) is None) == (source.missing(telemetry, now) is not None)
        return source.missing(telemetry, now)

    assert missing(30.0, 5.0) is None
    assert missing(30.1, 5.0 + 0.9 * LONGEST_STANDSTILL) is None
    assert missing(30.3, 5.1) is not None
    assert missing(30.1, 5.1 + LONGEST_STANDSTILL) is not None
