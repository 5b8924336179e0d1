"""Flying the plant's physics from a test, without clock and link."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.plant.physics.dynamics import TABLE_ROWS, WORK_SHAPE, advance
from sitl_bridge.plant.physics.parameters import parameters
from sitl_bridge.plant.physics.state import (
    INNER_SIZE,
    LOAD_VELOCITY,
    MOST_ROTORS,
    REACTIONS_SIZE,
    VEHICLE_VELOCITY,
    initial_inner_state,
    initial_state,
)
from sitl_bridge.plant.sensors.instruments import MEASUREMENT
from sitl_bridge.plant.sensors.truth import measure
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle, validated

Array = NDArray[np.float64]

EVER = 2**60  # steps that one row of a table of forces or winds holds, for a constant one


class Flight:
    """One plant under test: change `x`, `inner`, `command`, `forces`, `winds` as you like, then `run`."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.record = parameters(vehicle)
        self.x = initial_state(vehicle)
        self.inner = initial_inner_state(vehicle)
        self.command = np.zeros(MOST_ROTORS)
        self.forces = np.zeros((TABLE_ROWS, 6))
        self.winds = np.zeros((TABLE_ROWS, 6))
        self.reactions = np.zeros(REACTIONS_SIZE)
        assert self.inner.shape == (INNER_SIZE,)
        self._advance = advance.bind(
            self.record,
            self.x,
            self.inner,
            self.command,
            self.forces,
            self.winds,
            np.zeros(WORK_SHAPE),
        )
        self._measure = measure.bind(
            self.record,
            self.x,
            self.inner,
            self.forces[0],
            self.winds[0],
            np.zeros(WORK_SHAPE),
            np.zeros(3),
            self.reactions,
            np.zeros(1, dtype=MEASUREMENT),
        )

    def run(self, duration: float, step: float = 1e-3) -> None:
        """Fly on with everything held, then fill `reactions`."""
        self._advance(0, 0, EVER, EVER, round(duration / step), step)
        self._measure(0, 0.0)

    def path(
        self,
        duration: float,
        every: float,
        step: float = 1e-3,
        control: Callable[[float], None] | None = None,
    ) -> Array:
        """States (n + 1, 19), one `every` seconds; `control(time)` may change the commands at each."""
        states = [self.x.copy()]
        for index in range(round(duration / every)):
            if control is not None:
                control(index * every)
            self.run(every, step)
            states.append(self.x.copy())
        return np.array(states)


def flight(name: str, *overrides: str) -> Flight:
    """A plant of a shipped vehicle."""
    return Flight(load_vehicle(name, overrides))


def flight_without_cable(name: str, *overrides: str) -> Flight:
    """A plant of a shipped vehicle whose cable breaks with the first newton; no description may say so."""
    vehicle = load_vehicle(name, overrides)
    weak = vehicle.cable.model_copy(update={"breaking_tension": 1e-9})
    return Flight(vehicle.model_copy(update={"cable": weak}))


def energy(vehicle: Vehicle, x: Array) -> Any:
    """Kinetic, potential and elastic energy of state(s) (…, 19), J; the cable's where it is stretched."""
    length = np.linalg.norm(x[..., 13:16] - x[..., 0:3], axis=-1)
    stretch = length - vehicle.cable.rest_length
    if vehicle.cable.model == "tension-only":
        stretch = np.maximum(stretch, 0.0)
    return (
        0.5 * vehicle.airframe.mass * np.sum(x[..., VEHICLE_VELOCITY] ** 2, axis=-1)
        + 0.5 * vehicle.load.mass * np.sum(x[..., LOAD_VELOCITY] ** 2, axis=-1)
        + 0.5 * np.sum(np.asarray(vehicle.airframe.inertia) * x[..., 10:13] ** 2, axis=-1)
        + vehicle.gravity * (vehicle.airframe.mass * x[..., 2] + vehicle.load.mass * x[..., 15])
        + 0.5 * vehicle.cable.stiffness * stretch**2
    )


def plain_vehicle(**changes: Any) -> Vehicle:
    """Two bodies on a tension-only cable in empty space: no ground, no air, no lag; `changes` by table."""
    content: dict[str, Any] = {
        "name": "test",
        "airframe": {"mass": 2.0, "inertia": [0.03, 0.04, 0.05]},
        "rotors": [
            {
                "position": position,
                "direction": direction,
                "thrust_coefficient": 1e-3,
                "torque_coefficient": 1e-4,
                "max_speed": 2000.0,
            }
            for position, direction in (
                ([0.2, -0.2, 0.0], "ccw"),
                ([-0.2, 0.2, 0.0], "ccw"),
                ([0.2, 0.2, 0.0], "cw"),
                ([-0.2, -0.2, 0.0], "cw"),
            )
        ],
        "cable": {"stiffness": 200.0, "damping": 0.0, "rest_length": 1.0},
        "load": {"mass": 0.7},
    }
    for table, entries in changes.items():
        content[table] = {**content.get(table, {}), **entries} if isinstance(entries, dict) else entries
    return validated(Vehicle, content, "test")
