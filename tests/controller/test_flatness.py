"""The feed-forward motion against the plant's equations of motion."""

from __future__ import annotations

import numpy as np
import pytest
from coordinates import paper_state, plant_state
from fleet import FLEET, attributes

from controller.allocation import allocation
from controller.flatness import STENCIL, body, flat_motion
from controller.reference import Path, circle, setpoint
from controller.state import BODY_RATES, STATE_SIZE, WRENCH_SIZE, Array
from sitl_bridge.plant import dynamics
from sitl_bridge.plant.parameters import parameters
from sitl_bridge.vehicle import Vehicle

ORIGIN = (0.0, 0.0, 0.0)
PATHS = {
    "V.B": setpoint((3.0, 5.0, 2.0), ORIGIN),
    "3 m": setpoint((3.0, 0.0, 0.0), ORIGIN),
    "V.C": circle((0.0, 0.0, 5.0), 5.0, 1.0, ORIGIN),
}
NAMES = ("paper", "paper, 10 m", "small", "large", "tiny, heavy load", "long")


def flat(vehicle: Vehicle, path: Path, t: float, lead: float = 0.0) -> tuple[Array, Array]:
    """x* (18,) at t and u* (4,) at t + lead."""
    state, wrench = np.full(STATE_SIZE, np.nan), np.full(WRENCH_SIZE, np.nan)
    record = np.array([body(vehicle)], dtype=body(vehicle).dtype)
    scratch = attributes(np.zeros(1, dtype=STENCIL))
    flat_motion(attributes(record), attributes(path), t, lead, scratch, state, wrench)
    return state, wrench


def plant_rates(vehicle: Vehicle, state: Array, wrench: Array) -> Array:
    """Time derivative (18,) of eq. 31 by the plant's equations, the rotors giving this wrench."""
    a = allocation(vehicle)[0]
    rotors = len(vehicle.rotors)
    speeds = np.zeros(16)
    lift = a["inverse"][:rotors] @ wrench
    speeds[:rotors] = np.sqrt(lift / a["thrust_coefficient"][:rotors])
    x, rates = plant_state(state).real, np.zeros(19)
    dynamics.derivative(attributes(parameters(vehicle)), x, speeds, np.zeros(6), rates)
    tiny = 1e-30
    return np.asarray(paper_state(x + 1j * tiny * rates).imag / tiny)


@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS)
@pytest.mark.parametrize("name", NAMES)
def test_the_motion_satisfies_the_plants_equations(name: str, path: Path) -> None:
    """Everywhere but in the body's rates, whose moments are left to the feedback."""
    vehicle = FLEET[name]
    h = 1e-3
    worst = np.zeros(STATE_SIZE)
    for t in np.linspace(0.05, float(path["ramp_time"][0]) + 3.0, 60):
        state, wrench = flat(vehicle, path, t)
        slope = (flat(vehicle, path, t + h)[0] - flat(vehicle, path, t - h)[0]) / (2.0 * h)
        worst = np.maximum(worst, np.abs(plant_rates(vehicle, state, wrench) - slope))
    worst[BODY_RATES] = 0.0
    print(name, worst)
    assert worst[0:6].max() < 1e-5  # m/s
    assert worst[6:12].max() < 0.03  # m/s²
    assert worst[15:18].max() < 1e-4  # rad/s
