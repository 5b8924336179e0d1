"""What a flight from point to point came to, on a motion whose figures are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.law.reference import points, setpoint
from sitl.report.metrics import flight_metrics, reference_positions
from sitl.report.outcome import judge
from sitl.report.points import as_flown, last_set, path_metrics, unset
from tests.sitl.report.test_outcome import FACTS, IRIS, hovering

TIMES = np.arange(0.0, 30.0 + 1e-9, 0.004)
POSITIONS = ((2.0, 0.0, 10.0), (2.0, 4.0, 10.0))
PATH = points(POSITIONS, 2.0, (0.0, 0.0, 10.0))
FLOWN = as_flown(PATH, [0.0, 10.0])


def load() -> np.ndarray:  # type: ignore[type-arg]
    """To each point exponentially, 1/s; past the first one by a tenth of its step."""
    since = np.where(TIMES < 10.0, TIMES, TIMES - 10.0)[:, None]
    start = np.where(TIMES[:, None] < 10.0, PATH["start"][0], PATH["start"][1])
    goal = reference_positions(FLOWN, TIMES)
    out: np.ndarray = goal + (start - goal) * np.exp(-since)  # type: ignore[type-arg]
    out[1000, 0] = 2.2
    return out


def test_the_reference_is_the_point_that_was_set_last() -> None:
    positions = reference_positions(FLOWN, TIMES)
    assert positions[TIMES < 10.0 - 1e-9].tolist() == [list(POSITIONS[0])] * 2500
    assert positions[2500].tolist() == list(POSITIONS[1])
    assert last_set(FLOWN) == 10.0
    assert last_set(PATH) == 0.0  # not flown yet
    assert reference_positions(PATH, TIMES)[-1].tolist() == list(POSITIONS[0])


def test_the_figures_are_those_at_the_last_point_and_of_each() -> None:
    found = path_metrics(FLOWN, TIMES, load())
    first, last = found["points"]
    assert found["settled"]
    assert (
        found["settling_time_2pct_s"] == last["settling_time_2pct_s"] == pytest.approx(math.log(50), abs=0.01)
    )
    assert found["overshoot_pct"] == last["overshoot_pct"] == pytest.approx(0.0, abs=0.01)
    assert first["overshoot_pct"] == pytest.approx(10.0)
    assert (first["step_m"], last["step_m"]) == (2.0, 4.0)
    assert (first["set_at_s"], last["set_at_s"]) == (0.0, 10.0)
    assert found["steady_state_error_m"] < 1e-3  # of the last part, not of the way between


def test_one_point_is_judged_as_a_set_point_is() -> None:
    path = setpoint(POSITIONS[0], (0.0, 0.0, 10.0))
    plain = flight_metrics(TIMES, load(), reference_positions(path, TIMES))
    assert path_metrics(path, TIMES, load()) == {**plain, "points": None}


def test_a_point_that_was_not_set_is_said() -> None:
    flown = as_flown(PATH, [0.0])
    settled = np.tile(POSITIONS[0], (len(TIMES), 1))
    found = path_metrics(flown, TIMES, settled)
    assert not found["settled"]
    assert found["points"][1]["set_at_s"] is None
    assert unset(found["points"]) == "it was over before point 2 of 2 was set"
    outcome = judge(hovering(), np.tile((0.0, 0.0, 10.0), (1000, 1)), IRIS, {**FACTS, **found})
    assert outcome.outcome == "did not settle"
    assert outcome.outcome_cause == "it was over before point 2 of 2 was set"


def test_a_far_point_is_no_running_away() -> None:
    reference = np.tile((0.0, 0.0, 10.0), (1000, 1))
    reference[500:, 0] = 150.0
    assert judge(hovering(), reference, IRIS, FACTS).outcome == "settled"
    states = hovering()
    states["load_y_m"][900:] = 1600.0
    assert judge(states, reference, IRIS, FACTS)[:2] == ("ran away", 3.6)
