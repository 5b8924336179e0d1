"""The product itself: two processes, real sockets, the figures of the paper's experiments."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from pymavlink import mavutil

Fly = Callable[..., dict[str, Any]]

KEYS = {
    *("scenario", "vehicle", "design", "feedback", "seed", "clock", "rate_hz", "settled"),
    *("settling_time_2pct_s", "settling_time_1cm_s", "overshoot_pct", "steady_state_error_m"),
    *("tracking_rms_m", "real_time_factor", "lateness_us", "late_ticks", "resent_ticks"),
    *("state_log", "state_log_sha256"),
}


def test_setpoint_in_lockstep_and_what_it_leaves(fly: Fly) -> None:
    summary = fly("setpoint")
    assert summary.keys() >= KEYS
    assert summary["settled"]
    assert summary["settling_time_2pct_s"] <= 6.0
    assert summary["steady_state_error_m"] <= 1e-3
    log = Path(summary["state_log"])
    assert hashlib.sha256(log.read_bytes()).hexdigest() == summary["state_log_sha256"]
    table = pq.read_table(log)
    assert table.num_rows == 30 * 250 + 1
    assert {"time_s", "load_x_m", "vehicle_z_m", "cable_length_m", "rotor_4_rad_s"} <= set(table.column_names)
    assert table["load_y_m"].to_pylist()[-1] == pytest.approx(5.0, abs=1e-3)
    picture = Path(summary["picture"]).read_bytes()
    assert picture.startswith(b"\x89PNG")
    tlog = mavutil.mavlink_connection(summary["tlog"])
    counts: dict[str, int] = {}
    while (message := tlog.recv_match()) is not None:
        counts[message.get_type()] = counts.get(message.get_type(), 0) + 1
    assert counts["HIL_ACTUATOR_CONTROLS"] >= 30 * 250
    assert counts["HIL_SENSOR"] >= 30 * 250
    assert counts["ODOMETRY"] >= 2 * 30 * 250
    assert counts["HIL_GPS"] == pytest.approx(300, abs=20)
    assert "BAD_DATA" not in counts


def test_the_same_seed_gives_the_same_log_whatever_is_lost(fly: Fly) -> None:
    noisy = ("--set", "disturbance.force_std=5", "--duration", "6")
    once = fly("setpoint", *noisy, expect=1)  # too short to have settled
    again = fly("setpoint", *noisy, "--drop", "10", expect=1)
    other = fly("setpoint", *noisy, "--seed", "1", expect=1)
    assert again["resent_ticks"] > 100
    assert once["state_log_sha256"] == again["state_log_sha256"]
    assert once["state_log_sha256"] != other["state_log_sha256"]


def test_the_papers_design_responds_as_in_continuous_time(fly: Fly) -> None:
    summary = fly("setpoint", "--design", "paper")
    assert summary["settling_time_2pct_s"] == pytest.approx(6.3, abs=0.1)
    assert summary["overshoot_pct"] == pytest.approx(25, abs=1.5)
    assert summary["steady_state_error_m"] <= 1e-3


@pytest.mark.parametrize("ticks", [1, 2, 4])
def test_the_default_design_bears_a_delay_that_it_is_not_told_of(fly: Fly, ticks: int) -> None:
    undelayed = fly("setpoint", "--duration", "15")
    delayed = fly("setpoint", "--duration", "15", "--plant-set", f"loop.delay_ticks={ticks}")
    assert delayed["settling_time_2pct_s"] == pytest.approx(undelayed["settling_time_2pct_s"], rel=0.1)


def test_setpoint_settles_in_real_time(fly: Fly) -> None:
    summary = fly("setpoint", "--duration", "15", clock="realtime")
    assert summary["settled"]
    assert summary["lateness_us"]["p50"] is not None


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
    summary = fly("hover", "--vehicle", "iris", "--duration", "0.2", expect=1)
    assert summary["settling_time_2pct_s"] is None
    assert summary["settled_tolerance_m"] == 0.3
    assert summary["steady_state_error_m"] < 0.05


def test_a_load_that_does_not_settle_is_exit_code_1(fly: Fly) -> None:
    summary = fly("setpoint", "--duration", "6", "--design", "paper-lqr", expect=1)
    assert not summary["settled"]
