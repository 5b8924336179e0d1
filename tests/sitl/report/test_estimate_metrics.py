"""Figures of the estimate, from logs whose errors are known."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from controller.feedback.log import COLUMNS, COVARIANCE_COLUMNS, UPPER
from sitl.report.estimate_metrics import Log, errors, estimate_metrics
from sitl_bridge.frames import quaternion_from_euler
from sitl_bridge.plant.physics.state import COLUMNS as TRUE_COLUMNS

ROWS = 5001


@pytest.fixture(scope="module")
def logs() -> tuple[Log, Log, Log]:
    """25 s at 200 Hz in which estimates err by drawn errors of known covariance, the first 20 s surprised."""
    generator = np.random.default_rng(4)
    times = np.arange(ROWS) / 200.0
    euler = generator.uniform(-0.3, 0.3, (ROWS, 3))
    state = generator.standard_normal((ROWS, len(TRUE_COLUMNS)))
    state[:, 6:10] = [quaternion_from_euler((a, b, c)) for a, b, c in euler.tolist()]
    truth = np.hstack(
        [state[:, 0:3], state[:, 13:16], state[:, 3:6], state[:, 16:19], state[:, 10:13], euler]
    )
    root = 0.1 * generator.standard_normal((18, 18))
    error = generator.standard_normal((ROWS, 18)) @ root.T
    # While it finds its feet, fewer are in bounds.
    within = np.where(times < 20.0, 2.0, 9.0)
    innovations = np.cumsum(np.stack([np.full(ROWS, 10.0), within], axis=1), axis=0)
    estimate = np.hstack([times[:, None], truth - error, innovations])
    covariance = np.tile((root @ root.T)[UPPER], (ROWS // 10 + 1, 1))
    return (
        {"time_s": times, **dict(zip(TRUE_COLUMNS, state.T, strict=True))},
        dict(zip(COLUMNS, estimate.T, strict=True)),
        dict(zip(COVARIANCE_COLUMNS, np.hstack([times[::10, None], covariance]).T, strict=True)),
    )


def test_of_known_errors(logs: tuple[Log, Log, Log]) -> None:
    state, estimate, covariance = logs
    load = np.stack([state[f"load_{axis}_m"] for axis in "xyz"], axis=1)
    figures = estimate_metrics(state, estimate, covariance, load - [0.1, -0.2, 0.0])
    assert figures["load_rms_m"] == pytest.approx([0.1, 0.2, 0.0])
    assert figures["innovations_in_bounds"] == pytest.approx(0.9)
    assert figures["nees_mean"] == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / (100 * 15)))
    late = state["time_s"] >= 20.0
    relative = [
        (state[f"load_{axis}_m"] - estimate[f"load_{axis}_m"])
        - (state[f"vehicle_{axis}_m"] - estimate[f"vehicle_{axis}_m"])
        for axis in "xyz"
    ]
    expected = [np.sqrt(np.mean(axis[late] ** 2)) for axis in relative]
    assert figures["load_relative_rms_m"] == pytest.approx(expected)


def test_a_row_that_was_lost_shifts_nothing(logs: tuple[Log, Log, Log]) -> None:
    state, estimate, covariance = logs
    load = np.stack([state[f"load_{axis}_m"] for axis in "xyz"], axis=1)
    whole = estimate_metrics(state, estimate, covariance, load)
    kept = np.delete(np.arange(ROWS), [4100, 4500, 4501])
    fewer = {name: column[kept] for name, column in estimate.items()}
    parts = estimate_metrics(state, fewer, covariance, load)
    assert parts["nees_mean"] == pytest.approx(whole["nees_mean"], rel=0.05)
    assert parts["load_relative_rms_m"] == pytest.approx(whole["load_relative_rms_m"], rel=0.01)
    assert parts["innovations_in_bounds"] == pytest.approx(0.9)


@pytest.mark.filterwarnings("error")
def test_what_no_row_tells_is_none(logs: tuple[Log, Log, Log]) -> None:
    state, estimate, covariance = logs
    load = np.stack([state[f"load_{axis}_m"] for axis in "xyz"], axis=1)
    early = {name: column[:1] for name, column in covariance.items()}
    assert estimate_metrics(state, estimate, early, load)["nees_mean"] is None
    empty = {name: column[:0] for name, column in estimate.items()}
    only_early = {name: column[:100] for name, column in estimate.items()}
    assert estimate_metrics(state, only_early, early, load)["innovations_in_bounds"] is None
    figures = estimate_metrics(state, empty, {name: column[:0] for name, column in covariance.items()}, load)
    assert figures == {
        "load_relative_rms_m": None,
        "load_rms_m": [0.0, 0.0, 0.0],
        "nees_mean": None,
        "innovations_in_bounds": None,
    }


def test_angles_differ_the_short_way_round() -> None:
    truth, estimate = np.zeros((1, 18)), np.zeros((1, 18))
    truth[0, 17], estimate[0, 17] = 3.1, -3.1
    assert errors(truth, estimate)[0, 17] == pytest.approx(6.2 - 2.0 * np.pi)


def test_the_page_explains_the_figures_and_the_columns(logs: tuple[Log, Log, Log]) -> None:
    state, estimate, covariance = logs
    load = np.stack([state[f"load_{axis}_m"] for axis in "xyz"], axis=1)
    page = (Path(__file__).resolve().parents[3] / "docs" / "estimator.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`(\w+)`", page))
    figures = {*estimate_metrics(state, estimate, covariance, load), "load_relative_bound_m"}
    assert figures <= named
    whole = [name for name in COLUMNS if not re.search(r"_v?[yzqr]_", name)]  # the rest by its ending
    assert set(whole) <= named
    assert {re.sub(r"^\w*(?=_v?[yzqr]_)", "", name) for name in COLUMNS if name not in whole} <= named
    assert {COVARIANCE_COLUMNS[0], COVARIANCE_COLUMNS[1], COVARIANCE_COLUMNS[-1]} <= named
