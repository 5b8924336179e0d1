"""What happened to a vehicle, in a word."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sitl_bridge.plant.lost_vehicle import condition
from sitl_bridge.plant.physics.state import ATTITUDE, BODY_RATES, VEHICLE_POSITION, initial_state
from sitl_bridge.vehicle.files import load_vehicle


@pytest.mark.parametrize(
    ("height", "roll_deg", "cable_holds", "expected"),
    [
        (10.0, 0.0, True, None),
        (10.0, 40.0, True, None),
        (10.0, 0.0, False, "load lost"),
        (10.0, 170.0, True, "upside down"),
        (0.05, 80.0, True, "crashed"),
        (0.05, 175.0, False, "crashed"),
    ],
)
def test_condition(height: float, roll_deg: float, cable_holds: bool, expected: str | None) -> None:
    vehicle = load_vehicle("iris")
    state = initial_state(vehicle)
    half = math.radians(roll_deg) / 2
    state[VEHICLE_POSITION] = [0.0, 0.0, height]
    state[ATTITUDE] = [math.cos(half), math.sin(half), 0.0, 0.0]
    assert condition(vehicle, state, cable_holds) == expected


def test_a_vehicle_that_tumbles_or_flies_away_is_out_of_control() -> None:
    vehicle = load_vehicle("iris")
    away = initial_state(vehicle)
    away[VEHICLE_POSITION] = [1e4, 0.0, 10.0]
    tumbling = initial_state(vehicle)
    tumbling[VEHICLE_POSITION] = [0.0, 0.0, 10.0]
    tumbling[ATTITUDE] = [math.cos(0.5), math.sin(0.5), 0.0, 0.0]
    tumbling[BODY_RATES] = [8.0, 0.0, 0.0]
    assert {condition(vehicle, state, True) for state in (away, tumbling)} == {"out of control"}


def test_a_vehicle_on_its_legs_has_no_condition() -> None:
    vehicle = load_vehicle("iris", ["initial.start=ground"])
    assert condition(vehicle, np.asarray(initial_state(vehicle)), True) is None
