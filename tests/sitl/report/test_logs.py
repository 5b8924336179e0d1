"""How much a flight leaves: `--logs`, and `logs=` in Python."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sitl
from sitl.command_line.commands import main
from sitl.recording.recording import read_columns
from sitl.recording.sensors import frames, read_sensors
from sitl_bridge.mavlink.hil import HIL_ACTUATOR_CONTROLS
from sitl_bridge.rowlog import RowLog

SECONDS = 2.0


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> sitl.Flight:
    return fly(tmp_path_factory.mktemp("usual"), "usual")


@pytest.fixture(scope="module")
def complete(tmp_path_factory: pytest.TempPathFactory) -> sitl.Flight:
    return fly(tmp_path_factory.mktemp("all"), "all")


def fly(out: Path, logs: Any) -> sitl.Flight:
    return sitl.fly("hover", vehicle="iris", duration_s=SECONDS, out=out, logs=logs)


def names(folder: Path) -> set[str]:
    return {file.name for file in folder.iterdir()}


def test_states_are_the_same_whatever_is_kept_besides(usual: sitl.Flight, complete: sitl.Flight) -> None:
    assert usual.summary["state_log_sha256"] == complete.summary["state_log_sha256"]
    assert usual.out is not None
    assert complete.out is not None
    assert names(usual.out) == names(complete.out)


def test_fewer_estimates_and_frames_are_kept_by_default(usual: sitl.Flight, complete: sitl.Flight) -> None:
    ticks = round(SECONDS * 250)
    assert usual.estimates is not None
    assert complete.estimates is not None
    assert len(complete.estimates["time_s"]) == ticks
    assert len(usual.estimates["time_s"]) == ticks // 5
    for name, column in usual.estimates.items():
        assert np.array_equal(column, complete.estimates[name][::5]), name
    assert usual.out is not None
    assert complete.out is not None
    few, every = (read_sensors(folder / "link.tlog") for folder in (usual.out, complete.out))
    assert len(every.sensors) >= ticks
    assert len(few.sensors) == pytest.approx(10 * SECONDS, abs=1)
    # The scenario's time begins with the first armed answer, which is recorded in any case.
    assert set(np.rint(few.sensor_times * 1e6)) <= set(np.rint(every.sensor_times * 1e6))
    assert np.array_equal(few.fixes, every.fixes)
    first = next(f for _, f in frames(usual.out / "link.tlog") if f.message_id == 93)
    assert first.message_id == HIL_ACTUATOR_CONTROLS.message_id


def test_of_no_logs_only_the_summary_is_left(tmp_path: Path, usual: sitl.Flight) -> None:
    flight = fly(tmp_path, "none")
    assert names(tmp_path) == {"summary.json"}
    assert json.loads((tmp_path / "summary.json").read_text()) == flight.summary
    assert flight.summary["outcome"] == usual.summary["outcome"]
    for name, column in flight.states.items():
        assert np.array_equal(column, usual.states[name]), name


def test_the_command_leaves_only_the_summary(
    tmp_path: Path, usual: sitl.Flight, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "flight"
    command = ["fly", "hover", "--vehicle", "iris", "--in-process", "--duration", str(SECONDS), "--json"]
    main([*command, "--out", str(out), "--logs", "none"])
    assert names(out) == {"summary.json"}
    summary = json.loads(capsys.readouterr().out)
    assert summary == json.loads((out / "summary.json").read_text())
    assert summary["state_log_sha256"] == usual.summary["state_log_sha256"]
    assert summary["estimate"]["load_rms_m"] == usual.summary["estimate"]["load_rms_m"]
    assert {summary[key] for key in ("state_log", "tlog", "picture")} == {None}
    assert summary["estimate"]["estimate_log"] is None


def test_a_column_in_single_precision_is_that_and_others_are_exact(tmp_path: Path) -> None:
    file = tmp_path / "rows.parquet"
    log = RowLog(file, ["time_s", "x"], {"x"})
    rows = np.array([[0.1, 0.1], [1e5 / 3.0, 1e5 / 3.0]])
    log.write(rows)
    log.close()
    found = read_columns(file)
    assert np.array_equal(found["time_s"], rows[:, 0])
    assert np.array_equal(found["x"], rows[:, 1].astype(np.float32).astype(np.float64))
