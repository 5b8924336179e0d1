"""What is computed of every law beside its flights: the delay that it bears, effort, the cost of a step."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.design.catalogue import design
from controller.design.motion.ramp import planned
from controller.law.allocation import MOST_ROTORS, allocation
from controller.law.control_law import WORK, Design, engaged_memory
from controller.law.control_step import control_step
from controller.law.reference import setpoint
from controller.law.state import STATE_SIZE
from sitl.report.metrics import flight_metrics
from sitl.studies.paper import offline
from sitl.studies.paper.analysis.step import TARGET, vehicle_with
from sitl_bridge.vehicle.description import Vehicle

Array = NDArray[np.float64]

ORIGIN = (0.0, 0.0, 0.0)
NUDGE = 1e-3
"""m, by which the vehicle starts off its place, to see whether that grows"""
WATCHED = 12.0
"""s"""
TICK = 1.0 / offline.RATE_HZ


def effort(times: Array, rotors: Array, until: float) -> float:
    """Rms deviation (rad/s) of rotor speeds (n, rotors) from those at the end, over the first seconds."""
    first = rotors[times <= until] - rotors[-1]
    return float(np.sqrt(np.mean(first**2)))


def borne_in_flight(vehicle: Vehicle, record: Design, about: float) -> float:
    """The longest delay, s, of whole ticks that the law is not told of, with which a nudge dies away.

    Looked for around a delay (s).
    """
    x, y, z = vehicle.initial_vehicle_position
    nudged = vehicle_with(
        f"{vehicle.cable.rest_length:g}", f"initial.vehicle_position=[{x + NUDGE}, {y + NUDGE}, {z}]"
    )
    at = nudged.initial_load_position
    borne = 0
    for ticks in range(max(0, round(about / TICK) - 2), round(about / TICK) + 3):
        motion = offline.closed_loop(nudged, record, setpoint(at, at), WATCHED, delay_ticks=ticks)
        tilt = np.abs(motion.states[:, 15:17]).max(axis=1)
        third = len(tilt) // 3
        if motion.diverged or tilt[-third:].max() > tilt[third : 2 * third].max():
            break
        borne = ticks
    return borne * TICK


def learning_nothing(length: str, plant: tuple[str, ...], duration: float) -> dict[str, Any]:
    """Metrics of V.B by the default design with nothing learnt."""
    told, flown = vehicle_with(length), vehicle_with(length, *plant)
    record = design("default", told, offline.RATE_HZ)
    record["adapts"] = 0
    motion = offline.closed_loop(flown, record, planned(setpoint(TARGET, ORIGIN), told), duration)
    return {**flight_metrics(motion.time, motion.load, np.tile(TARGET, (len(motion.time), 1)))}


def step_cost(vehicle: Vehicle, record: Design) -> float:
    """Seconds that a control step takes along a motion: the quickest of some runs."""
    path = planned(setpoint(TARGET, ORIGIN), vehicle)
    estimate = np.zeros(STATE_SIZE)
    estimate[2] = vehicle.hover_length
    memory = engaged_memory(np.zeros(3))
    step = control_step.bind(
        record,
        allocation(vehicle),
        path,
        memory,
        np.zeros(1, dtype=WORK),
        estimate,
        np.zeros(MOST_ROTORS),
    )
    quickest = np.inf
    for _ in range(20):
        memory["ticks"] = 1
        begun = time.perf_counter()
        for _ in range(200):
            step()
        quickest = min(quickest, (time.perf_counter() - begun) / 200)
    return float(quickest)
