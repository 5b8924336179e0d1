"""The interactive report: what is drawn is what was flown."""

from __future__ import annotations

import base64
import gzip
import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.recording.recording import read_recording, write_reference
from sitl.report.html_report import (
    DISTANCE,
    envelope,
    marked_events,
    slack_spans,
    swing_deg,
    tilt_deg,
    two_sigma,
    write_html,
)
from sitl.report.page import said
from sitl_bridge.event_log import Event, EventLog
from tests.sitl.export.flights import leave_flight


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=400), st.integers(4, 60))
def test_a_thinned_line_keeps_its_extremes_and_its_ends(values: list[float], most: int) -> None:
    column = np.array(values)
    times, kept = envelope(np.arange(len(values), dtype=float), column, most)
    assert len(kept) <= max(most + 2, 2)
    assert kept.min() == column.min()
    assert kept.max() == column.max()
    assert (times[0], times[-1]) == (0.0, len(values) - 1.0)
    assert np.all(np.diff(times) > 0)


def test_swing_and_tilt_of_known_positions(tmp_path: Path) -> None:
    leave_flight(tmp_path, rows=2)
    recording = read_recording(tmp_path)
    # The load is 1 m north of the vehicle, 1.5 m below it; roll 0, pitch 0.3 rad at the start.
    assert swing_deg(recording)[0] == pytest.approx(np.degrees(np.arctan2(1.0, 1.5)))
    assert tilt_deg(recording)[0] == pytest.approx(np.degrees(0.3))


def test_slack_stretches_are_found() -> None:
    tension = np.array([1.0, 0.0, 0.0, 2.0, 0.0])
    assert slack_spans(np.arange(5.0), tension) == [(1.0, 2.0), (4.0, 4.0)]


def test_the_page_is_self_contained_and_its_data_is_the_flight(tmp_path: Path) -> None:
    leave_flight(tmp_path)
    recording = read_recording(tmp_path)
    page = tmp_path / "flight.html"
    write_html(recording, page)
    text = page.read_text(encoding="utf-8")
    assert not re.search(r'(src|href)="', text)
    data = re.search(r'id="data">(.*?)</script>', text, re.DOTALL)
    assert data is not None
    figure = json.loads(gzip.decompress(base64.b64decode(data[1])))
    traces = {trace["name"]: trace for trace in figure["data"]}
    layout = figure["layout"]
    for trace in figure["data"]:  # each line is named beside its own panel
        top = layout[trace["yaxis"].replace("y", "yaxis")]["domain"][1]
        assert layout[trace["legend"]]["y"] == top
    assert max(traces["x of the load"]["y"]) == pytest.approx(recording.states["load_x_m"].max(), rel=1e-5)
    assert {f"rotor {n}" for n in range(1, 5)} < set(traces)
    assert set(traces["saturated about y"]["y"]) == {18.0}
    assert "feedforward" not in traces  # 0 all the time


def test_modes_and_faults_are_marked_and_everything_is_listed(tmp_path: Path) -> None:
    leave_flight(tmp_path, rows=3)
    diary = EventLog(tmp_path)
    diary.add(Event(None, "controller", "mode", "disarmed"))
    diary.add(Event(0.25, "plant", "fault", "gps is lost"))
    diary.add(Event(0.5, "controller", "mode", "Land"))
    diary.add(Event(0.75, "controller", "statustext", "<b>Landing</b>"))
    recording = read_recording(tmp_path)
    assert [event.text for event in marked_events(recording.events)] == ["gps is lost", "Land"]
    write_html(recording, tmp_path / "flight.html")
    text = (tmp_path / "flight.html").read_text(encoding="utf-8")
    rows = re.findall(r"<tr><td>(.*?)</td><td>(.*?)</td><td>(.*?)</td><td>(.*?)</td></tr>", text)
    assert [row[3] for row in rows] == ["disarmed", "gps is lost", "Land", "&lt;b&gt;Landing&lt;/b&gt;"]
    assert rows[1][0] == "0.25 s"


def test_without_a_reference_there_is_no_distance_from_it(tmp_path: Path) -> None:
    leave_flight(tmp_path, rows=3)
    write_reference(tmp_path, np.zeros(0), np.zeros((0, 3)))
    write_html(read_recording(tmp_path), tmp_path / "flight.html")
    data = re.search(r'id="data">(.*?)</script>', (tmp_path / "flight.html").read_text("utf-8"), re.DOTALL)
    assert data is not None
    figure = json.loads(gzip.decompress(base64.b64decode(data[1])))
    titles = {axis["title"]["text"] for name, axis in figure["layout"].items() if name.startswith("yaxis")}
    assert DISTANCE not in titles
    assert not any("set-point" in trace["name"] for trace in figure["data"])


def test_the_band_is_two_standard_deviations_of_the_loads_position() -> None:
    covariance = {"time_s": np.array([0.0, 0.2])}
    covariance |= {f"covariance_{n}_{n}": np.full(2, 0.01 * (n + 1)) for n in range(18)}
    times, deviations = two_sigma(covariance, 2)
    assert times.tolist() == [0.0, 0.2]
    assert deviations == pytest.approx(2.0 * np.sqrt([0.06, 0.06]))


def test_how_it_ended_is_said_in_words() -> None:
    summary = {
        "outcome": "did not settle",
        "outcome_cause": "0.4 m off",
        "clock": "lockstep",
        "rate_hz": 250.0,
    }
    assert said(summary) == (
        "Outcome: did not settle, 0.4 m off. Clock: lockstep at 250 Hz. "
        "Link: no tick late, sent again, or without an answer."
    )
    assert "3 ticks sent again" in said({**summary, "resent_ticks": 3, "late_ticks": 0})
    assert said({}) == "Outcome: not known. Link: no tick late, sent again, or without an answer."
