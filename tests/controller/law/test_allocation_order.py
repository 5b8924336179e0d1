"""Rotor commands against linear programmes, for each that gives way: roll and pitch, thrust, yaw."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

from controller.law.allocation import MOST_ROTORS, allocate, allocation
from controller.law.state import Array
from sitl_bridge.vehicle.description import Vehicle
from tests.controller.fleet import attributes
from tests.controller.law.test_allocation import layout, regular, rotor

UNEQUAL = layout(
    [
        rotor(2 * math.pi * (i + shift) / 5, arm, ("ccw", "cw")[i % 2], size)
        for i, (shift, arm, size) in enumerate(
            [(0.1, 0.3, 1.0), (-0.1, 0.25, 1.3), (0.0, 0.35, 0.8), (0.15, 0.3, 1.1), (-0.05, 0.28, 0.9)]
        )
    ]
)
VEHICLES = {"quad": regular(4), "hexa": regular(6), "unequal": UNEQUAL}


def expected_thrusts(vehicle: Vehicle, wrench: Array) -> tuple[Array, bool]:
    """Thrust of each rotor, N, and whether anything gave way."""
    record = allocation(vehicle)[0]
    count = len(vehicle.rotors)
    inverse, largest = record["inverse"][:count], record["largest_thrust"][:count]
    lift, lean, yaw = inverse[:, 0], inverse[:, 1:3] @ wrench[1:3], inverse[:, 3] * wrench[3]
    limits = np.concatenate([largest, np.zeros(count)])

    def most(columns: list[Array], cost: list[float], bounds: list[Any]) -> Array:
        """Variables within bounds and rotor limits at the least cost."""
        matrix = np.column_stack(columns)
        return np.asarray(linprog(cost, np.vstack([matrix, -matrix]), limits, bounds=bounds).x)

    span = most([lift, lean], [0.0, -1.0], [(None, None), (0.0, 1.0)])[1]
    fixed = (span * (1 - 1e-9), span * (1 - 1e-9))  # a rotor at its limit leaves no room for rounding
    low, high = (most([lift, lean], [sign, 0.0], [(None, None), fixed])[0] for sign in (1.0, -1.0))
    thrust = min(max(wrench[0], low), high)
    base = np.clip(lift * thrust + span * lean, 0.0, largest)
    room = np.where(yaw > 0.0, largest - base, -base) / np.where(yaw == 0.0, 1e-300, yaw)
    share = min(1.0, room[yaw != 0.0].min(initial=1.0))
    limited = span < 1 - 1e-7 or share < 1 - 1e-7 or abs(thrust - wrench[0]) > 1e-7 * vehicle.hover_thrust
    return base + share * yaw, limited


@pytest.mark.parametrize("name", VEHICLES)
def test_what_gives_way_and_how_far(name: str) -> None:
    vehicle = VEHICLES[name]
    record, count = allocation(vehicle), len(vehicle.rotors)
    size, rng = vehicle.hover_thrust, np.random.default_rng(3)
    seen = set()
    for scale in (0.02, 0.2, 1.0, 4.0):
        for _ in range(8):
            wrench = size * np.array(
                [rng.uniform(-0.2, 4.5), *(scale * rng.normal(size=3) * (0.1, 0.1, 0.01))]
            )
            controls, achieved = np.full(MOST_ROTORS, 0.5), np.full(4, np.nan)
            limited = allocate(attributes(record), wrench, controls, achieved, np.zeros((2, MOST_ROTORS)))
            thrusts, expected = expected_thrusts(vehicle, wrench)
            speeds = controls[:count] * record[0]["largest_speed"][:count]
            given = record[0]["thrust_coefficient"][:count] * speeds**2
            np.testing.assert_allclose(given, thrusts, atol=1e-6 * size)
            np.testing.assert_allclose(achieved, record[0]["effect"][:, :count] @ given, atol=1e-9 * size)
            assert limited == expected
            assert (controls[count:] == 0.5).all()
            seen.add(limited)
    assert seen == {False, True}


def test_the_record_of_a_vehicle() -> None:
    (record,) = allocation(UNEQUAL)
    assert record["rotor_count"] == 5
    assert record["largest_thrust"][:5] == pytest.approx([10.0 * s for s in (1.0, 1.3, 0.8, 1.1, 0.9)])
    assert record["thrust_coefficient"][:5] == pytest.approx([1e-5 * s for s in (1.0, 1.3, 0.8, 1.1, 0.9)])
    assert (record["largest_speed"][:5] == 1000.0).all()
    for name in ("largest_thrust", "thrust_coefficient", "largest_speed"):
        assert not record[name][5:].any()
    np.testing.assert_allclose(record["effect"][:, :5] @ record["inverse"][:5], np.eye(4), atol=1e-9)
    assert not record["effect"][:, 5:].any()
    assert not record["inverse"][5:].any()
