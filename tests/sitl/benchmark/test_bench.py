"""The benchmark's keys are those that its page explains; limits are judged; rows measure what they say."""

from __future__ import annotations

import os
import re
import resource
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.estimator.filter import Estimator
from sitl.benchmark import bench, footprint, in_process
from sitl.benchmark import ground as ground_bench
from sitl.benchmark import gym as gym_bench
from sitl.benchmark.limits import LIMITS, Limit, check, check_all, check_table, spread_of
from sitl.command_line.commands import main
from sitl_bridge.vehicle.files import load_vehicle

PAGE = Path(__file__).resolve().parents[3] / "docs" / "benchmark.md"


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
    monkeypatch.setattr(in_process, "FLIGHT_S", 0.2)
    monkeypatch.setattr(in_process, "_flights_per_minute", lambda workers: 2.0)
    memory = {f"memory_mb_{name}": 2.0 for name in ("plant", "controller")}
    monkeypatch.setattr(bench, "memory_figures", lambda: memory)
    monkeypatch.setattr(footprint, "_logs_mb", two)
    return


@pytest.mark.usefixtures("instantly")
def test_the_page_explains_the_keys() -> None:
    results = bench.medians(bench.bench(1))
    keys = documented_keys()
    assert sorted(results) == sorted(keys)
    assert {limit.key for limit in LIMITS} <= results.keys()
    for key in results:
        if key.endswith(("_ratio", "per_round_trip")) and not key.startswith("in_process"):
            assert results[key] in (1.0, 1000.0)  # of equal figures; a tick is 1 / (2 * 250 Hz), a trip 2 us


@pytest.mark.parametrize(
    ("samples", "at_least", "verdict"),
    [
        ([1.0, 1.5, 2.0], False, "met"),
        ([2.0, 2.0, 2.0], False, "met"),
        ([2.0, 2.1, 3.0], False, "within spread"),
        ([2.1, 2.1, 2.1], False, "missed"),
        ([3.0, 4.0, 5.0], False, "missed"),
        ([3.0, 4.0, 5.0], True, "met"),
        ([1.0, 1.9, 2.5], True, "within spread"),
        ([1.0, 1.1, 1.2], True, "missed"),
        ([2.5], False, "missed"),
        ([], False, "not measured"),
    ],
)
def test_a_limit_is_judged_by_the_median_and_the_spread(
    samples: list[float], at_least: bool, verdict: str
) -> None:
    assert check(Limit("x", 2.0, at_least), samples).verdict == verdict


def test_the_spread_leaves_out_single_hiccups() -> None:
    assert spread_of([1.0, 1.0, 1.0, 1.0, 900.0]) == 0.0
    assert spread_of([1.0, 2.0, 3.0, 4.0, 5.0]) == 1.0


@pytest.mark.parametrize(("factor", "code"), [(250.0, 0), (100.0, 1)])
def test_the_check_exits_with_1_where_a_limit_is_missed(
    factor: float, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    samples = {"in_process_real_time_factor": [factor] * 3}
    monkeypatch.setattr(bench, "bench", lambda repeats: samples)
    assert main(["bench", "--check"]) == code
    assert check_table(check_all(samples)) in capsys.readouterr().out


def test_the_tick_in_process_is_that_of_a_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(in_process, "FLIGHT_S", 2.0)
    figures = in_process.in_process_figures(250.0)
    assert min(figures.values()) > 0.0
    for suffix in ("", "_estimate"):
        simulated = figures[f"in_process_tick_us{suffix}"] * figures[f"in_process_real_time_factor{suffix}"]
        assert simulated == pytest.approx(4000.0)


def test_memory_is_what_the_system_says() -> None:
    found = footprint.peak_memory_mb(os.getpid())
    assert found is None or found == pytest.approx(
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6, rel=0.05
    )
    assert footprint.peak_memory_mb(2**30) is None


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
