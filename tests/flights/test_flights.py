"""The figures of the paper's experiments, and of other designs, rates and starts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

Fly = Callable[..., dict[str, Any]]


def test_the_papers_design_responds_as_in_continuous_time(fly: Fly) -> None:
    summary = fly("setpoint", "--design", "paper")
    assert summary["settling_time_2pct_s"] == pytest.approx(6.3, abs=0.1)
    assert summary["overshoot_pct"] == pytest.approx(25, abs=1.5)
    assert summary["steady_state_error_m"] <= 1e-3


def test_the_default_design_bears_a_delay_that_it_is_not_told_of(fly: Fly) -> None:
    undelayed = fly("setpoint", "--duration", "15")
    for ticks in (1, 2, 4):
        delayed = fly("setpoint", "--duration", "15", "--plant-set", f"loop.delay_ticks={ticks}")
        assert delayed["settling_time_2pct_s"] == pytest.approx(undelayed["settling_time_2pct_s"], rel=0.1)


def test_hover_under_force_and_circle(fly: Fly) -> None:
    assert fly("hover", "--duration", "20", "--set", "disturbance.force_std=5")["settled"]
    circle = fly("circle", "--duration", "30")
    assert circle["settled"]
    assert circle["tracking_rms_m"] < 0.05


@pytest.mark.parametrize("rate", ["100", "500"])
def test_other_rates(fly: Fly, rate: str) -> None:
    summary = fly("setpoint", "--duration", "12", "--rate", rate)
    assert summary["settled"]
    assert summary["settling_time_2pct_s"] <= 6.0


def test_a_start_on_the_ground_is_judged_from_where_the_load_lies(fly: Fly) -> None:
    """The description puts it 1 m up, the ground wants it lower: a hover there is no step."""
    truth = ("--feedback", "truth")
    summary = fly("hover", "--vehicle", "iris", "--duration", "0.2", *truth, expect=1)
    assert summary["settling_time_2pct_s"] is None
    assert summary["settled_tolerance_m"] == 0.3
    assert summary["steady_state_error_m"] < 0.05


def test_a_load_that_does_not_settle_is_exit_code_1(fly: Fly) -> None:
    summary = fly("setpoint", "--duration", "6", "--design", "paper-lqr", expect=1)
    assert not summary["settled"]
