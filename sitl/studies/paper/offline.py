"""Plant and controller in one process, without the link: for open-loop motions and for sweeps.

The same physics, law and rotor limits as in a flight, a thousand times as fast as real time.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.law.allocation import MOST_ROTORS, allocation
from controller.law.control_law import WORK, Design, engaged_memory
from controller.law.control_step import control_step
from controller.law.reference import Path
from controller.law.state import STATE_SIZE
from sitl.command_line.arguments import DEFAULT_RATE_HZ
from sitl_bridge.frames import euler_from_quaternion
from sitl_bridge.plant.physics import state as plant
from sitl_bridge.plant.physics.world import World
from sitl_bridge.vehicle.description import Vehicle

Array = NDArray[np.float64]

RATE_HZ = DEFAULT_RATE_HZ
"""Every flight of the page, over the link or not: at what `sitl fly` flies at."""
LOST = 1e3
"""A load that is so far away, m, has been lost: the simulation ends."""


class Motion(NamedTuple):
    """A simulated motion, ENU and FLU."""

    time: Array
    """(n,) s"""
    states: Array
    """(n, 18), eq. 31"""
    tension: Array
    """(n,) N"""
    limited: Array
    """(n,) whether a rotor was at a limit"""
    diverged: bool

    @property
    def vehicle(self) -> Array:
        """Vehicle's position (n, 3), m."""
        return self.states[:, 0:3]

    @property
    def load(self) -> Array:
        """Load's position (n, 3), m."""
        return self.states[:, 3:6]


def eq31(state: Array) -> list[float]:
    """State (18,) in the order of eq. 31 of the plant's state."""
    w, x, y, z = state[plant.ATTITUDE].tolist()
    return [
        *state[plant.VEHICLE_POSITION],
        *state[plant.LOAD_POSITION],
        *state[plant.VEHICLE_VELOCITY],
        *state[plant.LOAD_VELOCITY],
        *state[plant.BODY_RATES],
        *euler_from_quaternion((w, x, y, z)),
    ]


def cable_tension(vehicle: Vehicle, states: Array) -> Array:
    """Tension (n,) in N along states (n, 18) of eq. 31 (eq. 9, corrected)."""
    across, relative = states[:, 3:6] - states[:, 0:3], states[:, 9:12] - states[:, 6:9]
    length = np.linalg.norm(across, axis=1)
    rate = np.sum(across * relative, axis=1) / length
    return np.asarray(
        vehicle.cable.stiffness * (length - vehicle.cable.rest_length) + vehicle.cable.damping * rate
    )


def open_loop(vehicle: Vehicle, wrench: tuple[float, float, float, float], times: Array) -> Motion:
    """Hold the rotors at the speeds that give a wrench (N, N m); times: equidistant, s."""
    rate_hz = 1.0 / float(times[1] - times[0])
    world = World(vehicle, rate_hz, seed=0)
    record = allocation(vehicle)[0]
    lift = np.maximum(0.0, record["inverse"] @ np.array(wrench))
    with np.errstate(invalid="ignore"):
        speed = np.sqrt(lift / record["thrust_coefficient"])
        world.command(np.nan_to_num(speed / record["largest_speed"]).tolist())
    rows = [eq31(world.state)]
    for _ in times[1:]:
        world.advance(world.steps_per_tick)
        rows.append(eq31(world.state))
    states = np.array(rows)
    return Motion(times, states, cable_tension(vehicle, states), np.zeros(len(times), dtype=bool), False)


def closed_loop(
    vehicle: Vehicle,
    design: Design,
    path: Path,
    duration: float,
    rate_hz: float = RATE_HZ,
    delay_ticks: int = 0,
) -> Motion:
    """Fly a design along a path on the truth; the plant applies each command `delay_ticks` later."""
    world = World(vehicle, rate_hz, seed=0)
    estimate, controls = np.zeros(STATE_SIZE), np.zeros(MOST_ROTORS)
    estimate[:] = eq31(world.state)
    step = control_step.bind(
        design,
        allocation(vehicle),
        path,
        engaged_memory(estimate[3:6]),
        np.zeros(1, dtype=WORK),
        estimate,
        controls,
    )
    under_way = deque([world.trim_controls] * delay_ticks)
    ticks = round(duration * rate_hz)
    rows, limited, diverged = [estimate.copy()], np.zeros(ticks + 1, dtype=bool), False
    for tick in range(ticks):
        limited[tick] = bool(step())
        under_way.append(tuple(controls.tolist()))
        world.command(under_way.popleft())
        world.advance(world.steps_per_tick)
        estimate[:] = eq31(world.state)
        if not np.all(np.isfinite(estimate)) or float(np.max(np.abs(estimate[:6]))) > LOST:
            diverged = True
            break
        rows.append(estimate.copy())
    states = np.array(rows)
    times = np.arange(len(states)) / rate_hz
    return Motion(times, states, cable_tension(vehicle, states), limited[: len(states)], diverged)
