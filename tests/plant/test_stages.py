"""Stages and their due rules: what a tick has to do is done, whole or in parts, in both clocks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl_bridge.plant.clocks.realtime import Realtime
from sitl_bridge.plant.log.notices import Notices
from sitl_bridge.plant.log.state_log import StateLog
from sitl_bridge.plant.simulation import Simulation
from sitl_bridge.plant.stages import (
    EVER,
    Command,
    LoopDelay,
    Stage,
    due_rules,
    interval_ticks_left,
    ticks_left,
)
from sitl_bridge.vehicle.files import load_vehicle
from tests.plant.network import Faults, Network, autopilot_session

RATE_HZ = 250.0


def test_a_stage_needs_a_due_rule() -> None:
    with pytest.raises(TypeError, match="ticks_left"):
        Stage("new sensor", lambda: None)  # type: ignore[call-arg]


@given(st.lists(st.integers(1, 500), min_size=1, max_size=6), st.integers(0, 2000))
def test_whole_ticks_end_before_the_first_stage_is_due(intervals: list[int], tick: int) -> None:
    stages = [
        Stage(str(every), lambda: None, lambda every=every: interval_ticks_left(every, tick))  # type: ignore[misc]
        for every in intervals
    ]
    left = ticks_left(due_rules(stages))
    assert all((tick + k) % every != 0 for every in intervals for k in range(1, left + 1))
    assert any((tick + left + 1) % every == 0 for every in intervals)


@given(st.integers(0, 5), st.lists(st.floats(0.0, 1.0), max_size=20))
def test_a_loop_delay_keeps_the_order(ticks: int, values: list[float]) -> None:
    delay = LoopDelay(ticks)
    delay.restart(np.full(16, -1.0))
    passed = [float(delay.passed(np.full(16, value))[0]) for value in values]
    assert passed == ([-1.0] * ticks + values)[: len(values)]
    assert delay.due_rule() == (0 if ticks else EVER)


def realtime_flight(path: Path, whole: bool, answer_delay: float) -> int:
    """Fly 4 s against a clock that the test moves; returns how many ticks were measured in parts."""
    vehicle = load_vehicle("paper", ["disturbance.force_std=5", "sensors.preset=consumer"])
    simulation = Simulation(vehicle, RATE_HZ, 3, duration_s=4.0)
    log = StateLog(path, simulation.world)
    simulation.record_with(log)
    measure, measured = simulation.world.measure, 0

    def counted(tick: int, held: bool) -> None:
        nonlocal measured
        measured += simulation.started
        measure(tick, held)

    simulation.world.measure = counted  # type: ignore[method-assign]
    if not whole:
        in_parts: Callable[..., Any] = Simulation.fly_tick

        def fly_tick(commands: list[Command]) -> None:
            simulation.record_with(log)  # no whole tick before the next one in parts
            in_parts(simulation, commands)

        simulation.fly_tick = fly_tick  # type: ignore[method-assign, assignment]
    network = Network(
        Realtime(simulation, Notices(lambda text: None), 0),
        autopilot_session(vehicle),
        Faults(delay_s=answer_delay),
    )
    network.plant.start(network.now)
    network.run(lambda: simulation.finished)
    log.close()
    return measured


@pytest.mark.parametrize("answer_delay", [1e-6, 1.1e-3])
def test_real_time_flies_the_same_stages(answer_delay: float, tmp_path: Path) -> None:
    """Whole where commands act from a tick's start, in parts where they come in the middle of it."""
    in_whole = realtime_flight(tmp_path / "whole", True, answer_delay)
    in_parts = realtime_flight(tmp_path / "parts", False, answer_delay)
    assert in_parts == 4 * RATE_HZ - 1  # the last tick is not measured any more
    assert in_whole < 0.5 * in_parts if answer_delay < 1e-3 else in_whole > 0.9 * in_parts
    assert pq.read_table(tmp_path / "whole").equals(pq.read_table(tmp_path / "parts"))
