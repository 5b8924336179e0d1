"""The benchmark's keys are those that its page explains, and its estimator does a whole tick's work."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.estimator.filter import Estimator
from sitl.benchmark import bench
from sitl.benchmark import ground as ground_bench
from sitl.benchmark import gym as gym_bench
from sitl_bridge.vehicle.files import load_vehicle

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmark.md"


def documented_keys() -> list[str]:
    """First cells of the page's table of keys."""
    table = PAGE.read_text(encoding="utf-8").split("| key |")[1]
    return re.findall(r"^\| `(\w+)`", table, flags=re.MULTILINE)


@pytest.fixture
def instantly(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Everything that is measured takes no time and says 2."""
    two = lambda *arguments, **options: 2.0  # noqa: E731
    for name in ("physics_step_us", "control_step_us", "estimator_update_us", "round_trip_us"):
        monkeypatch.setattr(bench, name, two)
    monkeypatch.setattr(bench, "launch_to_first_command_s", two)
    end: dict[str, Any] = {"real_time_factor": 2.0, "lateness_us": {"p99": 2.0}, "late_ticks": 2}
    monkeypatch.setattr(bench, "lockstep_flight", lambda *arguments, **options: end)
    monkeypatch.setattr(ground_bench, "_flight", lambda *arguments: end)
    monkeypatch.setattr(gym_bench, "STEPS", 2)
    return


@pytest.mark.usefixtures("instantly")
def test_the_page_explains_the_keys() -> None:
    results = bench.bench(1)
    keys = documented_keys()
    assert sorted(results) == sorted(keys)
    for key in results:
        if key.endswith(("_ratio", "per_round_trip")):
            assert results[key] in (1.0, 1000.0)  # of equal figures; a tick is 1 / (2 * 250 Hz), a trip 2 us


def test_the_estimator_uses_every_sample_and_fixes_come_late(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Estimator] = []
    ages: list[float] = []

    class Watched(Estimator):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            made.append(self)

        def gps(self, time: float, *arguments: Any) -> None:
            ages.append(time)
            super().gps(time, *arguments)

        def tick(self, time: float) -> Any:
            if self.given["has_gps"]:
                ages[-1] = time - ages[-1]
            return super().tick(time)

    monkeypatch.setattr("controller.estimator.filter.Estimator", Watched)
    monkeypatch.setattr(bench, "STEPS", 4000)
    vehicle = load_vehicle("paper", ["sensors.preset=consumer"])
    assert bench.estimator_update_us(vehicle) > 0.0
    memory = made[0].memory
    assert not np.any(memory["rejected"])
    assert np.all(memory["nis_count"][:6] > 0)
    assert ages == pytest.approx([vehicle.sensors.gps.delay] * len(ages), abs=0.6 / bench.DEFAULT_RATE_HZ)
