"""A cable of another length than told: a tracker shows it."""

from __future__ import annotations

import numpy as np
import pytest

import sitl

TRACKER = [
    f"sensors.tracker.{key}" for key in ("rate=20", "delay=0.05", "angle_noise=0.01", "distance_noise=0.02")
]


def height_error(vehicle: str, rest_length: float, *overrides: str) -> float:
    """m, rms, of the load over the last 5 s of a hover."""
    flight = sitl.fly(
        "hover",
        vehicle=vehicle,
        feedback="estimate",
        overrides=[
            "sensors.preset=rtk",
            "initial.start=hover",
            "initial.load_position=[0, 0, 30]",
            *overrides,
        ],
        plant_overrides=[f"cable.rest_length={rest_length}"],
        seed=3,
        duration_s=20.0,
    )
    late = flight.states["time_s"] > 15.0
    assert np.any(late)
    error = flight.states["load_z_m"] - flight.reference[:, 2]
    return float(np.sqrt(np.mean(error[late] ** 2)))


@pytest.mark.parametrize(("vehicle", "rest_length"), [("iris", 1.35), ("heavy", 8.8)])
def test_a_tracker_shows_it(vehicle: str, rest_length: float) -> None:
    assert height_error(vehicle, rest_length, *TRACKER) < 0.06


def test_without_a_tracker_the_load_hangs_so_much_lower() -> None:
    assert height_error("heavy", 8.8) == pytest.approx(0.8, abs=0.05)
