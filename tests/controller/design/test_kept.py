"""Gains and motions on disk: what is computed anew for nobody, and what is never taken for something else."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from controller.design import kept
from controller.design.remembered import remembered
from controller.law.control_law import DESIGN
from sitl_bridge.compiled import cache

FLIGHT = """
import sys
import numpy as np
from controller.design.kept import keep_on_disk
from controller.law.reference import setpoint
from controller.pilot.autopilot import Autopilot
from sitl_bridge.vehicle.files import load_vehicle

keep_on_disk()
vehicle = load_vehicle("iris")
autopilot = Autopilot(vehicle, "default", 250.0, lambda start: setpoint((3.0, 5.0, 2.0), start), np.zeros(16))
estimate = np.zeros(18)
estimate[3] = 0.01  # not where the description says: the kept motion is flown from here
estimate[2] = vehicle.hover_length
autopilot.step(estimate, 0, 0.0)
print(autopilot.law[0].tobytes().hex(), autopilot.law[2].tobytes().hex())
print("scipy" in sys.modules)
"""

GUIDED = """
import sys
from controller.design.kept import keep_on_disk
from controller.ground.flight.motion.trajectory import Trajectory
import controller.pilot.guided.session

keep_on_disk()
print(Trajectory(0.004).path.tobytes().hex())
print("scipy" in sys.modules)
"""
"""What a flight under ground control takes beside its gains."""


@pytest.fixture
def disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty place for what is kept."""
    monkeypatch.setattr(cache, "directories", lambda: [tmp_path])
    monkeypatch.setattr(kept, "_on_disk", True)
    return tmp_path


def test_another_process_finds_every_bit(disk: Path) -> None:
    design = np.zeros(1, dtype=DESIGN)
    design["state_gain"], design["delay"] = np.nextafter(1.0, 2.0), 3
    kept.keep("gains", ("paper", 250.0), design)
    found = kept.find("gains", ("paper", 250.0))
    assert found.dtype == design.dtype
    assert found.tobytes() == design.tobytes()


@pytest.mark.parametrize("other", [("other", (1.0,)), ("gains", (np.nextafter(1.0, 2.0),)), ("gains", (1,))])
def test_nothing_else_is_taken_for_it(disk: Path, other: tuple[str, object]) -> None:
    kept.keep("gains", (1.0,), np.ones(3))
    assert kept.find(*other) is None
    assert kept.find("gains", (1.0,)) is not None


def test_other_sources_or_another_cpu_find_nothing(disk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept.keep("gains", 1.0, np.ones(3))
    for name in ("sources", "machine"):
        with monkeypatch.context() as changed:
            changed.setattr(kept, name, lambda: "another")
            assert kept.find("gains", 1.0) is None


def test_a_damaged_file_is_as_none(disk: Path) -> None:
    kept.keep("gains", 1.0, np.ones(3))
    [file] = disk.iterdir()
    content = bytearray(file.read_bytes())
    content[-40] ^= 1
    file.write_bytes(content)
    assert kept.find("gains", 1.0) is None


def test_those_used_last_are_kept(disk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept, "MOST", 2)
    for age, key in ((3, "a"), (2, "b"), (1, "c")):
        kept.keep("gains", key, np.ones(3))
        for file in disk.iterdir():
            os.utime(file, (file.stat().st_atime, file.stat().st_mtime - age))
    assert [kept.find("gains", key) is not None for key in "abc"] == [False, True, True]


def test_only_who_asks_for_it_keeps(disk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept, "_on_disk", False)
    assert remembered(2)(np.atleast_1d)(1.0) == 1.0
    assert list(disk.iterdir()) == []


@pytest.mark.parametrize("script", [FLIGHT, GUIDED], ids=["flight", "guided"])
def test_a_second_flight_takes_no_scipy(script: str, tmp_path: Path) -> None:
    """The machine code is where it always is; results go to an empty place."""
    start = f"""
from pathlib import Path
from controller.design.kept import files
code = files.directories
files.directories = lambda: [Path({str(tmp_path)!r}), *code()]
"""
    flights = [
        subprocess.run(
            [sys.executable, "-c", start + script], capture_output=True, text=True, check=True, timeout=600
        ).stdout.splitlines()
        for _ in range(2)
    ]
    assert flights[1][1] == "False"
    assert flights[0][0] == flights[1][0]
