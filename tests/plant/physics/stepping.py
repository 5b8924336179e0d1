"""Flying the plant's equations of motion from a test, without clock and link."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.plant.physics import dynamics
from sitl_bridge.plant.physics.parameters import PARAMETERS, Parameters
from sitl_bridge.plant.physics.state import CABLE_HOLDS, INNER_SIZE, MOST_ROTORS, STATE_SIZE
from sitl_bridge.vehicle.description import Vehicle

Array = NDArray[np.float64]

STEP = 1e-3
"""The plant's step, s."""


def fly(
    record: Parameters,
    start: Array,
    rotor_speed: Sequence[float] | Array,
    duration: float,
    step: float = STEP,
    every: int = 1,
    force: Sequence[float] | Array = (0.0,) * 6,
) -> Array:
    """States (n + 1, 19) at every `every`-th of n·every steps; rotors and force (6,) held."""
    state = start.copy()
    forces = np.zeros((dynamics.TABLE_ROWS, 6))
    forces[0] = force
    steps = round(duration / step)
    advance = dynamics.advance.bind(*arrays(record, state, rotor_speed, forces))
    states = [start.copy()]
    for first in range(0, steps, every):
        advance(first, 0, steps, steps, every, step)
        states.append(state.copy())
    return np.array(states)


def arrays(
    record: Any, state: Array, rotor_speed: Sequence[float] | Array, forces: Array
) -> tuple[Any, Array, Array, Array, Array, Array, Array]:
    """The array arguments of `dynamics.advance`: still air, the cable whole, the rotors at their speeds."""
    inner = np.zeros(INNER_SIZE)
    inner[: len(rotor_speed)] = rotor_speed
    inner[CABLE_HOLDS] = 1.0
    return (
        record,
        state,
        inner,
        padded(rotor_speed),
        forces,
        np.zeros((dynamics.TABLE_ROWS, 6)),
        np.zeros(dynamics.WORK_SHAPE),
    )


def derivative(
    record: Parameters, state: Array, rotor_speed: Sequence[float] | Array, force: Array | None = None
) -> Array:
    """The plant's derivative (19,), by the uncompiled kernel."""
    out = np.zeros(STATE_SIZE)
    external = np.zeros(6) if force is None else force
    dynamics.derivative(fields(record), state, padded(rotor_speed), external, out)
    return out


def fields(record: Parameters) -> Any:
    """The record's fields as attributes, as compiled code sees them."""
    return SimpleNamespace(**{name: record[0][name] for name in PARAMETERS.names or ()})


def padded(rotor_speed: Sequence[float] | Array) -> Array:
    """Rotor speeds in an array as long as the plant's."""
    out = np.zeros(MOST_ROTORS)
    out[: len(rotor_speed)] = rotor_speed
    return out


def rotor_speeds(vehicle: Vehicle, thrust: float, moment: Sequence[float] = (0.0, 0.0, 0.0)) -> Array:
    """Rotor speeds (n,) that give this thrust (N) and moment (3,) (N m, FLU), by least squares."""
    columns = []
    for rotor in vehicle.rotors:
        lever = np.cross(rotor.position, (0, 0, rotor.thrust_coefficient))
        lever[2] += rotor.torque_coefficient * (-1 if rotor.direction == "ccw" else 1)
        columns.append([rotor.thrust_coefficient, *lever])
    squared = np.linalg.lstsq(np.array(columns).T, np.array([thrust, *moment]), rcond=None)[0]
    speeds: Array = np.sqrt(squared)
    return speeds
