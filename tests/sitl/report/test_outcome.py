"""How a flight ended, in a word: settled or lost, when and why."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import sitl
from sitl.flights.free_ports import free_ports
from sitl.report.outcome import FELL, judge
from sitl.terminal.summary import IN_WORDS
from sitl_bridge.plant.lost_vehicle import GRACE
from sitl_bridge.vehicle.files import load_vehicle

IRIS = load_vehicle("iris", ["initial.start=hover", "initial.load_position=[0,0,10]"])


def hovering(rows: int = 1000) -> dict[str, np.ndarray]:  # type: ignore[type-arg]
    zeros = np.zeros(rows)
    states = {f"{body}_{axis}_m": zeros.copy() for body in ("vehicle", "load") for axis in "xyz"}
    states |= {f"attitude_q{part}": zeros.copy() for part in "xyz"} | {"attitude_qw": zeros + 1.0}
    states["time_s"] = np.arange(rows) / 250.0
    states["vehicle_z_m"] += 11.5
    states["load_z_m"] += 10.0
    return states


FACTS = {"completed": True, "failure": None, "settled": True, "settling_time_2pct_s": 1.5}
REFERENCE = np.tile((0.0, 0.0, 10.0), (1000, 1))


def test_a_settled_flight_says_so() -> None:
    assert judge(hovering(), REFERENCE, IRIS, FACTS) == ("settled", 1.5, None)


def test_what_happens_first_is_the_outcome() -> None:
    states = hovering()
    states["attitude_qx"][500:] = 1.0
    states["vehicle_z_m"][700:] = 0.0
    outcome = judge(states, REFERENCE, IRIS, FACTS)
    assert outcome[:2] == ("turned over", 2.0)
    states["attitude_qx"][:] = 0.0
    assert judge(states, REFERENCE, IRIS, FACTS)[:2] == ("hit the ground", 2.8)
    states["vehicle_z_m"][:] = 11.5
    states["load_x_m"][900:] = 101.0
    assert judge(states, REFERENCE, IRIS, FACTS)[:2] == ("ran away", 3.6)


@pytest.mark.parametrize(
    ("facts", "outcome", "says"),
    [
        (
            {"settled": False, "largest_error_at_end_m": 0.5, "settled_tolerance_m": 0.1},
            "did not settle",
            "0.50 m off",
        ),
        ({"failure": "stopped by SIGINT"}, "interrupted", "SIGINT"),
        ({"failure": "the plant was killed by SIGKILL"}, "failed", "SIGKILL"),
    ],
)
def test_other_ends_have_their_reason(facts: dict[str, object], outcome: str, says: str) -> None:
    found = judge(hovering(), REFERENCE, IRIS, {**FACTS, "settled": False, **facts})
    assert found.outcome == outcome
    assert found.outcome_cause is not None
    assert says in found.outcome_cause


DEAD_ROTOR = """duration = 60
[reference]
kind = "hover"
[[faults.rotor]]
rotor = 1
at = 2.0
thrust = 0.0
"""


def test_a_vehicle_that_is_lost_is_named_and_the_flight_ends_soon_after(tmp_path: Path) -> None:
    file = tmp_path / "dead-rotor.toml"
    start = 'set = ["initial.start=hover", "initial.load_position=[0,0,30]"]\n'
    file.write_text('vehicle = "iris"\n' + start + DEAD_ROTOR)
    flight = sitl.fly(str(file), feedback="truth")
    lost_at = flight.summary["outcome_time_s"]
    assert flight.summary["outcome"] in FELL
    assert 2.0 < lost_at < 10.0
    assert lost_at + GRACE - 0.2 < flight.states["time_s"][-1] < lost_at + 2.0 * GRACE
    command = [sys.executable, "-m", "sitl", "fly", str(file), "--in-process", "--feedback", "truth"]
    command += ["--out", str(tmp_path / "out")]
    said = subprocess.run(command, capture_output=True, text=True, check=False)
    assert said.returncode == 1
    assert f"{IN_WORDS[flight.summary['outcome']]} at t = {lost_at:.2f} s" in said.stdout
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["outcome"] == flight.summary["outcome"]


def test_the_same_loss_ends_two_processes_at_the_same_tick(tmp_path: Path) -> None:
    file = tmp_path / "dead-rotor.toml"
    file.write_text('vehicle = "paper"\n' + DEAD_ROTOR)
    [port] = free_ports(1)
    command = [sys.executable, "-m", "sitl", "fly", str(file), "--clock", "lockstep", "--json"]
    command += ["--hil", f"udpout:127.0.0.1:{port}", "--out", str(tmp_path / "apart")]
    apart = json.loads(subprocess.run(command, capture_output=True, text=True, check=False).stdout)
    here = sitl.fly(str(file), out=tmp_path / "here").summary
    assert apart["state_log_sha256"] == here["state_log_sha256"]
    assert apart["outcome"] == here["outcome"]
    assert apart["outcome"] in FELL
    assert apart["time_s"] < 60.0
