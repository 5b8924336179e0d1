"""A hover on sensors that begins in whatever weather begins upright."""

from __future__ import annotations

import numpy as np
import pytest

import sitl

HOVER = ["initial.start=hover", "initial.load_position=[0, 0, 30]", "sensors.preset=consumer"]
"""The receiver is decimetres off at the start, and the load swings about where the estimate has it."""


def largest_tilt_deg(vehicle: str, seed: int, told: list[str], untold: list[str]) -> float:
    flight = sitl.fly(
        "hover",
        vehicle=vehicle,
        feedback="estimate",
        overrides=[*HOVER, *told],
        plant_overrides=untold,
        seed=seed,
        duration_s=4.0,
    )
    assert flight.states["time_s"][-1] > 3.9
    qx, qy = flight.states["attitude_qx"], flight.states["attitude_qy"]
    return float(np.degrees(np.arccos(np.min(1.0 - 2.0 * (qx**2 + qy**2)))))


@pytest.mark.parametrize("tracker", [[], ["sensors.tracker.rate=20"]], ids=["blind", "tracker"])
@pytest.mark.parametrize(("vehicle", "seed"), [("iris", 0), ("iris", 1), ("heavy", 0), ("heavy", 1)])
def test_in_still_air_it_hardly_leans(vehicle: str, seed: int, tracker: list[str]) -> None:
    assert largest_tilt_deg(vehicle, seed, tracker, []) < 12.0


@pytest.mark.parametrize(
    ("wind", "swing"),
    [("[8.5, 8.5, 0]", "[3, 0, 0]"), ("[8.5, 8.5, 0]", "[1, 0, 0]"), ("[12, 0, 0]", "[0, 3, 0]")],
)
def test_a_sudden_storm_leans_it_by_little_more_than_it_takes(wind: str, swing: str) -> None:
    """12 m/s of wind alone take 22 degrees."""
    untold = [f"air.wind={wind}", "air.turbulence.wind_at_6_m=17", f"initial.load_velocity={swing}"]
    assert largest_tilt_deg("iris", 0, [], untold) < 38.0
