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
    summary = fly("setpoint", "--logs", "all")
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
    fixes = 0
    while (message := tlog.recv_match()) is not None:
        counts[message.get_type()] = counts.get(message.get_type(), 0) + 1
        # Before the first answer the world freewheels, the longer the busier the machine.
        fixes += message.get_type() == "HIL_GPS" and "HIL_ACTUATOR_CONTROLS" in counts
    assert counts["HIL_ACTUATOR_CONTROLS"] >= 30 * 250
    assert counts["HIL_SENSOR"] >= 30 * 250
    assert counts["ODOMETRY"] >= 2 * 30 * 250
    assert fixes == pytest.approx(300, abs=20)
    assert "BAD_DATA" not in counts


def test_the_same_seed_gives_the_same_log_whatever_is_lost(fly: Fly) -> None:
    noisy = ("--set", "disturbance.force_std=5", "--duration", "6", "--no-report")
    once = fly("setpoint", *noisy, expect=1)  # too short to have settled
    again = fly("setpoint", *noisy, "--drop", "10", expect=1)
    other = fly("setpoint", *noisy, "--seed", "1", expect=1)
    assert again["resent_ticks"] > 100
    assert once["state_log_sha256"] == again["state_log_sha256"]
    assert once["state_log_sha256"] != other["state_log_sha256"]


def test_setpoint_settles_in_real_time(fly: Fly) -> None:
    summary = fly("setpoint", "--duration", "15", clock="realtime")
    assert summary["settled"]
    assert summary["lateness_us"]["p50"] is not None
