"""What a flight came to, on motions whose figures are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.law.reference import circle, setpoint
from sitl.report.metrics import flight_metrics, reference_positions, settling_time

TIMES = np.arange(0.0, 30.0 + 1e-9, 0.004)
TARGET = np.array([3.0, 5.0, 2.0])


def reference(target: np.ndarray) -> np.ndarray:
    return np.tile(target, (len(TIMES), 1))


def test_an_exponential_approach() -> None:
    # error = |step|·exp(-t): 2 % after ln 50 s, 1 cm after ln(100·|step|) s
    load = TARGET * (1.0 - np.exp(-TIMES))[:, None]
    metrics = flight_metrics(TIMES, load, reference(TARGET))
    assert metrics["settled"]
    assert metrics["settling_time_2pct_s"] == pytest.approx(math.log(50), abs=0.005)
    size = float(np.linalg.norm(TARGET))
    assert metrics["settling_time_1cm_s"] == pytest.approx(math.log(100 * size), abs=0.005)
    assert metrics["overshoot_pct"] == pytest.approx(0.0, abs=1e-6)
    assert metrics["steady_state_error_m"] == pytest.approx(size * math.exp(-20), rel=1e-6)


def test_overshoot_is_that_of_the_worst_axis_in_percent_of_its_own_step() -> None:
    load = reference(TARGET).copy()
    load[0] = 0.0
    load[100] = [3.3, 5.1, 2.4]
    assert flight_metrics(TIMES, load, reference(TARGET))["overshoot_pct"] == pytest.approx(20.0)


def test_a_negative_step_overshoots_downwards() -> None:
    target = np.array([0.0, 0.0, -2.0])
    load = reference(target).copy()
    load[0] = 0.0
    load[50, 2] = -2.5
    assert flight_metrics(TIMES, load, reference(target))["overshoot_pct"] == pytest.approx(25.0)


def test_not_settled_when_it_leaves_within_the_last_seconds() -> None:
    load = reference(TARGET).copy()
    load[0] = 0.0
    load[-100, 0] += 0.2  # 2 % of the step is 0.123 m
    metrics = flight_metrics(TIMES, load, reference(TARGET))
    assert not metrics["settled"]
    assert metrics["settling_time_2pct_s"] == pytest.approx(TIMES[-99])


def test_without_a_step_near_enough_is_0_3_m() -> None:
    hover = np.zeros((len(TIMES), 3))
    near, far = hover + np.array([0.29, 0, 0]), hover + np.array([0.31, 0, 0])
    near[0] = far[0] = 0.0
    for load, settled in ((near, True), (far, False)):
        metrics = flight_metrics(TIMES, load, hover)
        assert metrics["settled"] is settled
        assert metrics["settling_time_2pct_s"] is None
        assert metrics["overshoot_pct"] is None


def test_settling_time_of_an_error_that_stays_outside_is_none() -> None:
    assert settling_time(TIMES, np.ones(len(TIMES)), 0.5) is None
    assert settling_time(TIMES, np.zeros(len(TIMES)), 0.5) == 0.0


def test_reference_of_the_circle_is_the_papers() -> None:
    path = circle((0.0, 0.0, 5.0), 5.0, 1.0, (0.0, 0.0, 0.0))
    positions = reference_positions(path, TIMES)
    expected = np.stack([5 * np.sin(TIMES), 5 * np.cos(TIMES), np.full(len(TIMES), 5.0)], axis=1)
    assert np.abs(positions - expected).max() < 1e-12
    still = reference_positions(setpoint((1.0, 2.0, 3.0), (0.0, 0.0, 0.0)), TIMES)
    assert (still == [1.0, 2.0, 3.0]).all()


def test_no_flight_is_asked_to_stay_nearer_than_its_sensors_tell() -> None:
    load = reference(TARGET).copy()
    load[0] = 0.0
    load[-100, 0] += 0.2  # 2 % of the step is 0.123 m
    for sensing_error_m, settled in ((0.0, False), (0.19, False), (0.21, True)):
        metrics = flight_metrics(TIMES, load, reference(TARGET), sensing_error_m)
        assert metrics["settled"] is settled
    assert metrics["settled_tolerance_m"] == 0.21
    assert metrics["settling_time_2pct_s"] == pytest.approx(TIMES[-99])


def test_the_end_of_a_short_flight_does_not_reach_back_to_its_start() -> None:
    load = TARGET * (1.0 - np.exp(-2.0 * TIMES))[:, None]
    short = TIMES <= 5.0
    metrics = flight_metrics(TIMES[short], load[short], reference(TARGET)[short])
    assert metrics["largest_error_at_end_m"] == pytest.approx(
        float(np.linalg.norm(TARGET)) * math.exp(-2.0 * 10.0 / 3.0), rel=0.01
    )
