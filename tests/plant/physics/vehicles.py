"""Random vehicles, states and rotor speeds for property tests."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from hypothesis import strategies as st

from sitl_bridge.plant.physics.parameters import Parameters, parameters
from sitl_bridge.plant.physics.state import (
    ATTITUDE,
    BODY_RATES,
    LOAD_POSITION,
    LOAD_VELOCITY,
    STATE_SIZE,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
)
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle
from sitl_bridge.vehicle.rotors import Rotor
from tests.plant.physics.stepping import Array


class Case(NamedTuple):
    """A vehicle somewhere in flight."""

    vehicle: Vehicle
    record: Parameters
    state: Array  # (19,)
    rotor_speed: Array  # (rotors,) rad/s
    force: Array  # (6,) N, external, world


def vector(largest: float) -> st.SearchStrategy[tuple[float, float, float]]:
    component = st.floats(-largest, largest)
    return st.tuples(component, component, component)


@st.composite
def cases(draw: st.DrawFn, model: str = "two-way", powered: bool = True, slack: bool = False) -> Case:
    """A random vehicle of 4 to 8 rotors with its load, from 0.9 (slack: 0.5) to 1.5 rest lengths away."""
    rotors = tuple(
        Rotor.model_validate(
            {
                "position": draw(vector(1)),
                "direction": draw(st.sampled_from(["cw", "ccw"])),
                "thrust_coefficient": draw(st.floats(1e-3, 0.02)),
                "torque_coefficient": draw(st.floats(0, 0.05)),
                "max_speed": 1e4,
            }
        )
        for _ in range(draw(st.integers(4, 8)))
    )
    strong = tuple(rotor.model_copy(update={"max_speed": 1e4}) for rotor in load_vehicle("paper").rotors)
    east, north, up = draw(st.tuples(*[st.floats(0.05, 0.5)] * 3))  # second moments, kg m²
    description: dict[str, Any] = {
        "name": "random",
        "gravity": draw(st.floats(1, 15)),
        "airframe": {
            "mass": draw(st.floats(0.5, 20)),
            "inertia": (north + up, east + up, east + north),
        },
        "rotors": strong,
        "cable": {
            "stiffness": draw(st.floats(20, 500)),
            "damping": draw(st.floats(0, 20)),
            "rest_length": draw(st.floats(2, 10)),
            "model": model,
        },
        "load": {"mass": draw(st.floats(0.5, 20))},
    }
    # Laws of physics hold for any rotors, also for such as no description may have, since nothing could
    # be steered with them.
    vehicle = Vehicle.model_validate(description).model_copy(update={"rotors": rotors})
    polar, azimuth = draw(st.floats(0, math.pi)), draw(st.floats(-math.pi, math.pi))
    along = np.array(
        [math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), math.cos(polar)]
    )
    quaternion = np.array(draw(st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: math.hypot(*q) > 0.1)))
    state = np.zeros(STATE_SIZE)
    state[VEHICLE_POSITION] = draw(vector(20))
    state[VEHICLE_VELOCITY] = draw(vector(2))
    state[ATTITUDE] = quaternion / np.linalg.norm(quaternion)
    state[BODY_RATES] = draw(vector(3))
    stretch = draw(st.floats(0.5 if slack else 0.9, 1.5))
    state[LOAD_POSITION] = state[VEHICLE_POSITION] + stretch * vehicle.cable.rest_length * along
    state[LOAD_VELOCITY] = draw(vector(2))
    speeds = [draw(st.floats(0, 20)) if powered else 0.0 for _ in rotors]
    force = draw(st.tuples(*[st.floats(-10, 10)] * 6)) if powered else (0.0,) * 6
    return Case(vehicle, parameters(vehicle), state, np.array(speeds), np.array(force))
