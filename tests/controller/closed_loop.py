"""Plant and controller in one process, without link and clock."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from controller.law.allocation import MOST_ROTORS, allocation
from controller.law.control_law import WORK, Design, engaged_memory
from controller.law.control_step import control_step
from controller.law.reference import Path
from controller.law.state import LOAD_POSITION, STATE_SIZE, Array
from sitl.report.metrics import flight_metrics, reference_positions
from sitl_bridge.plant.physics.world import World
from sitl_bridge.vehicle.description import Vehicle
from tests.controller.coordinates import paper_state


class Flight(NamedTuple):
    times: Array  # (n,) s
    states: Array  # (n, 18), eq. 31
    controls: Array  # (n, 16)
    limited: Array  # (n,) whether a rotor was at a limit
    integral: Array  # (n, 3) m s
    metrics: dict[str, float | bool | None]  # see sitl.report.metrics


def fly(
    vehicle: Vehicle, design: Design, path: Path, duration: float, rate_hz: float, delay_ticks: int = 0
) -> Flight:
    """Fly a path from the vehicle's initial state; the plant applies commands `delay_ticks` later."""
    world = World(vehicle, rate_hz, seed=0)
    estimate, controls = np.zeros(STATE_SIZE), np.zeros(MOST_ROTORS)
    estimate[:] = paper_state(world.state).real
    memory = engaged_memory(estimate[LOAD_POSITION])
    work = np.zeros(1, dtype=WORK)
    step = control_step.bind(design, allocation(vehicle), path, memory, work, estimate, controls)
    under_way = deque([tuple(world.trim_controls)] * delay_ticks)
    rows = []
    for _ in range(round(duration * rate_hz) + 1):
        estimate[:] = paper_state(world.state).real
        limited = step()
        rows.append((estimate.copy(), controls.copy(), bool(limited), memory["integral"][0].copy()))
        under_way.append(tuple(controls.tolist()))
        world.command(under_way.popleft())
        world.advance(world.steps_per_tick)
    states, commands, at_limit, integral = (np.array(column) for column in zip(*rows, strict=True))
    times = np.arange(len(states)) / rate_hz
    load = states[:, LOAD_POSITION]
    metrics = flight_metrics(times, load, reference_positions(path, times))
    return Flight(times, states, commands, at_limit, integral, metrics)
