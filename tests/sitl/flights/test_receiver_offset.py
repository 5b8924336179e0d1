"""A receiver that is metres off, and wanders by metres, is not believed to the metre."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import sitl
from controller.feedback.log import COVARIANCE_NAME
from sitl.report.summary import read_state_log


@pytest.mark.parametrize("seed", [1, 2])
def test_a_hover_on_urban_sensors_begins_upright(seed: int) -> None:
    flight = sitl.fly(
        "hover",
        vehicle="heavy",
        feedback="estimate",
        overrides=["sensors.preset=urban", 'initial.start="hover"', "initial.load_position=[0,0,30]"],
        seed=seed,
        duration_s=20.0,
    )
    qx, qy = flight.states["attitude_qx"], flight.states["attitude_qy"]
    tilt_deg = np.degrees(np.arccos(1.0 - 2.0 * (qx**2 + qy**2)))
    assert flight.states["time_s"][-1] > 19.9
    assert np.max(tilt_deg) < 45.0


@pytest.mark.parametrize("seed", [40, 43])
def test_a_circle_on_urban_sensors_keeps_its_height(seed: int) -> None:
    """The barometer tells the receiver's wander of 4 m from a climb; the load is dragged over no ground."""
    flight = sitl.fly(
        "circle",
        vehicle="iris",
        feedback="estimate",
        overrides=["sensors.preset=urban"],
        seed=seed,
        duration_s=20.0,
    )
    late = flight.states["time_s"] > 8.0
    assert np.any(late)
    assert np.max(np.abs(flight.states["load_z_m"] - flight.reference[:, 2])[late]) < 1.5
    assert not [text for text in flight.said if " wrong by " in text]


def test_the_doubt_of_a_place_holds_the_receivers_wander(tmp_path: Path) -> None:
    """The estimated place is off by as much as its covariance says."""
    squares = []
    for seed in range(4):
        flight = sitl.fly(
            "hover",
            vehicle="iris",
            feedback="estimate",
            overrides=["sensors.preset=urban"],
            seed=seed,
            duration_s=20.0,  # an offset at the start has come in by then
            out=tmp_path / str(seed),
        )
        assert flight.estimates is not None
        covariance = read_state_log(tmp_path / str(seed) / COVARIANCE_NAME)
        for axis, name in enumerate(f"vehicle_{a}_m" for a in "xyz"):
            error = flight.estimates[name][-1] - flight.states[name][-1]
            squares.append(error**2 / covariance[f"covariance_{axis}_{axis}"][-1])
    assert 0.30 < np.mean(squares) < 2.18  # 98 % of chi-square with twelve degrees of freedom, per degree
