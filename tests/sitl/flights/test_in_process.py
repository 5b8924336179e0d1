"""Flights in one process: the same state log as two processes, for every scenario that flies by itself."""

from __future__ import annotations

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import sitl
from sitl.flights.free_ports import free_ports
from sitl.flights.scenario import Scenario, Setpoint
from sitl_bridge.event_log import read_events
from sitl_bridge.vehicle.files import DescriptionError, load_vehicle
from tests.patience import LONG_PATIENCE, PATIENCE
from tests.sitl.flights.test_scenarios import FLOWN


def fly(tmp_path: Path, scenario: str, *more: str) -> dict[str, object]:
    """The summary of `sitl fly`, a few seconds of it."""
    [port] = free_ports(1)
    command = [
        sys.executable,
        "-m",
        "sitl",
        "fly",
        scenario,
        "--seed",
        "5",
        "--json",
        "--no-report",
        "--duration",
        "6",
        *more,
    ]
    command += ["--hil", f"udpout:127.0.0.1:{port}", "--out", str(tmp_path)]
    flight = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONG_PATIENCE)
    assert flight.stdout, flight.stderr
    summary: dict[str, object] = json.loads(flight.stdout)
    return summary


@pytest.mark.parametrize("scenario", FLOWN)
def test_the_state_log_is_that_of_two_processes(scenario: str, tmp_path: Path) -> None:
    here = fly(tmp_path / "here", scenario, "--in-process")
    apart = fly(tmp_path / "apart", scenario, "--clock", "lockstep")
    assert here["completed"]
    assert here["state_log_sha256"] == apart["state_log_sha256"]
    assert here.keys() == apart.keys()
    faults = [
        [event for event in read_events(tmp_path / name) if event.kind == "fault"]
        for name in ("here", "apart")
    ]
    assert faults[0] == faults[1]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("hold",), "ground control"),
        (("hover", "--drop", "3"), "--drop"),
        (("hover", "--clock", "realtime"), "--clock realtime"),
        (("hover", "--clock", "lockstep", "--speed", "1"), "--speed"),
    ],
)
def test_what_takes_two_processes_is_refused(arguments: tuple[str, ...], says: str) -> None:
    command = [sys.executable, "-m", "sitl", "fly", *arguments, "--in-process"]
    outcome = subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE)
    assert outcome.returncode == 2
    assert says in outcome.stderr
    assert outcome.stderr.count("\n") == 1


def test_from_python_it_is_the_same_flight(tmp_path: Path) -> None:
    kept = sitl.fly("setpoint", seed=5, duration_s=6.0, out=tmp_path)
    flight = sitl.fly("setpoint", seed=5, duration_s=6.0)
    assert flight.summary["settling_time_2pct_s"] == kept.summary["settling_time_2pct_s"]
    assert flight.summary.keys() == kept.summary.keys()
    assert set(flight.states) == set(kept.states)
    for name, column in flight.states.items():
        np.testing.assert_array_equal(column, kept.states[name])
    assert flight.table().num_rows == len(flight.states["time_s"])
    assert (tmp_path / "flight.png").exists()
    flight.picture(tmp_path / "mine.png")
    assert (tmp_path / "mine.png").stat().st_size > 0


def test_estimates_are_there_where_they_were_flown_on(tmp_path: Path) -> None:
    flight = sitl.fly("hover", vehicle="iris", duration_s=3.0, out=tmp_path)
    assert flight.summary["feedback"] == "estimate"
    assert flight.estimates is not None
    assert "load_x_m" in flight.estimates
    assert sitl.fly("hover", duration_s=1.0).estimates is None


def test_vehicles_and_scenarios_may_be_objects() -> None:
    vehicle = load_vehicle("paper", ["load.mass=5"])
    scenario = Scenario(
        vehicle="paper", duration=12.0, reference=Setpoint(kind="setpoint", position=(1.0, 0.0, 0.5))
    )
    flight = sitl.fly(scenario, vehicle=vehicle)
    assert flight.summary["settled"]
    np.testing.assert_allclose(flight.reference[-1], (1.0, 0.0, 0.5))
    weight = 5.0 * vehicle.gravity
    assert flight.states["cable_tension_N"][-1] == pytest.approx(weight, rel=1e-3)


def test_flights_side_by_side_are_those_one_by_one() -> None:
    def hash_of(seed: int) -> int:
        flight = sitl.fly("hover", overrides=["disturbance.force_std=5"], seed=seed, duration_s=2.0)
        return hash(flight.states["load_x_m"].tobytes())

    with ThreadPoolExecutor(3) as pool:
        assert list(pool.map(hash_of, range(3))) == [hash_of(seed) for seed in range(3)]


def test_faults_of_a_description_are_an_exception_of_one_line_each() -> None:
    with pytest.raises(DescriptionError, match="rest_lenth"):
        sitl.fly("hover", overrides=["cable.rest_lenth=3"])
    with pytest.raises(DescriptionError, match="ground control"):
        sitl.fly("hold")
