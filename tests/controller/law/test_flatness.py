"""The feed-forward motion against the plant's equations of motion."""

from __future__ import annotations

import numpy as np
import pytest

from controller.design.motion.ramp import planned
from controller.law.allocation import allocation
from controller.law.flatness import STENCIL, body
from controller.law.reference import Path, circle, feasible, setpoint
from controller.law.state import (
    BODY_RATES,
    EULER_ANGLES,
    LOAD_POSITION,
    STATE_SIZE,
    VEHICLE_POSITION,
    WRENCH_SIZE,
    Array,
)
from sitl_bridge.plant.physics import dynamics
from sitl_bridge.plant.physics.parameters import parameters
from sitl_bridge.vehicle.description import Vehicle
from tests.controller.compiled_motion import motion
from tests.controller.coordinates import paper_state, plant_state
from tests.controller.fleet import FLEET, attributes

ORIGIN = (0.0, 0.0, 0.0)
PATHS = {
    "V.B": setpoint((3.0, 5.0, 2.0), ORIGIN),
    "3 m": setpoint((3.0, 0.0, 0.0), ORIGIN),
    "V.C": circle((0.0, 0.0, 5.0), 5.0, 1.0, ORIGIN),
}
NAMES = ("paper", "paper, 10 m", "small", "small, drag", "large", "tiny, heavy load", "long")


def flat(vehicle: Vehicle, path: Path, t: float, lead: float = 0.0, lag: float = 0.0) -> tuple[Array, Array]:
    """x* (18,) at t and u* (4,) at t + lead, for rotors that lag."""
    state, wrench = np.full(STATE_SIZE, np.nan), np.full(WRENCH_SIZE, np.nan)
    record = np.array([body(vehicle)], dtype=body(vehicle).dtype)
    yaw = float(path["yaw"][0])
    heading = np.array([np.cos(yaw), np.sin(yaw)])
    motion.bind(record, path, np.zeros(1, dtype=STENCIL), heading, state, wrench)(t, lead, lag)
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
    """To the error of differences over milliseconds."""
    vehicle, cable = FLEET[name], FLEET[name].cable
    h = 1e-3
    worst, snap, turning = np.zeros(STATE_SIZE), 0.0, 0.0
    out, scratch = np.zeros((6, 3)), np.zeros(6)
    for t in np.linspace(0.05, float(path["ramp_time"][0]) + 3.0, 60):
        state, wrench = flat(vehicle, path, t)
        slope = (flat(vehicle, path, t + h)[0] - flat(vehicle, path, t - h)[0]) / (2.0 * h)
        worst = np.maximum(worst, np.abs(plant_rates(vehicle, state, wrench) - slope))
        feasible(attributes(path), t, out, scratch)
        snap = max(snap, float(np.abs(out[4]).max()))
        turning = max(turning, float(np.abs(slope[BODY_RATES]).max()))
    # The damper is taken into account to first order; the next term of the series is its error.
    cable_error = (cable.damping / cable.stiffness) ** 2 * snap
    cable_error *= max(1.0, vehicle.load.mass / vehicle.airframe.mass)
    assert worst[0:6].max() < 2e-4  # m/s, by differences over milliseconds, as are the next
    assert worst[6:12].max() < 3e-3 + 1.5 * cable_error  # m/s²
    assert worst[EULER_ANGLES].max() < 2e-3  # rad/s
    assert worst[BODY_RATES].max() < 0.05 + 0.01 * turning  # rad/s²


@pytest.mark.parametrize("name", NAMES)
def test_a_planned_motion_satisfies_them_with_the_damper(name: str) -> None:
    """The cable's length is the damper's exactly, and the vehicle does not twist."""
    vehicle, path = FLEET[name], planned(PATHS["V.B"], FLEET[name])
    h = 1e-3
    worst, largest = np.zeros(STATE_SIZE), np.zeros(STATE_SIZE)
    for t in np.linspace(0.05, float(path["ramp_time"][0]) + 1.0, 60):
        state, wrench = flat(vehicle, path, t)
        slope = (flat(vehicle, path, t + h)[0] - flat(vehicle, path, t - h)[0]) / (2.0 * h)
        worst = np.maximum(worst, np.abs(plant_rates(vehicle, state, wrench) - slope))
        largest = np.maximum(largest, np.abs(slope))
        assert abs(state[BODY_RATES][2]) < 0.01
    turning = float(largest[BODY_RATES].max())
    assert worst[0:6].max() < 2e-4  # m/s, by differences over milliseconds, as are the next
    assert worst[6:12].max() < 3e-3 + 2e-3 * largest[6:12].max()  # m/s²
    assert worst[EULER_ANGLES].max() < 2e-3 + 4e-3 * largest[EULER_ANGLES].max()  # rad/s
    assert worst[BODY_RATES].max() < 0.05 + 0.02 * turning  # rad/s²


@pytest.mark.parametrize("name", NAMES)
def test_the_length_follows_the_tension_behind_the_ramp(name: str) -> None:
    """F = k (l - l0) + c l', by differences, until hover's length is reached."""
    vehicle, path = FLEET[name], planned(PATHS["V.B"], FLEET[name])
    cable, h = vehicle.cable, 1e-3
    out, scratch = np.zeros((6, 3)), np.zeros(6)

    def length(t: float) -> float:
        state, _ = flat(vehicle, path, t)
        return float(np.linalg.norm(state[VEHICLE_POSITION] - state[LOAD_POSITION]))

    duration = float(path["ramp_time"][0])
    for t in np.linspace(-0.1, 1.3 * duration, 40):
        feasible(attributes(path), t, out, scratch)
        drag = vehicle.load.drag
        speed = float(np.linalg.norm(out[1]))
        pull = vehicle.load.mass * out[2] + (drag.linear + drag.quadratic * speed) * out[1]
        pull[2] += vehicle.load.mass * vehicle.gravity
        given = cable.stiffness * (length(t) - cable.rest_length)
        given += cable.damping * (length(t + h) - length(t - h)) / (2.0 * h)
        assert given == pytest.approx(float(np.linalg.norm(pull)), rel=2e-3)
    assert length(10.0 * duration) == pytest.approx(vehicle.hover_length)


@pytest.mark.parametrize("name", ["small, lag", "large, lag"])
def test_lagging_rotors_are_asked_for_what_gives_the_thrust(name: str) -> None:
    """A speed that follows with the lag, squared, gives the thrust that the motion needs."""
    vehicle = FLEET[name]
    path = planned(PATHS["V.B"], vehicle)
    lag, h = vehicle.rotors[0].time_constant, 1e-3
    duration = float(path["ramp_time"][0])
    given = float(np.sqrt(vehicle.hover_thrust))
    errors, swings = [], []
    for t in np.arange(0.0, duration, h):
        asked = flat(vehicle, path, t, 0.5 * h, lag)[1][0]
        needed = flat(vehicle, path, t + h)[1][0]
        given += (1.0 - np.exp(-h / lag)) * (float(np.sqrt(asked)) - given)
        errors.append(abs(given**2 - needed))
        swings.append(abs(needed - vehicle.hover_thrust))
    assert max(errors) < 0.02 * max(swings)


@pytest.mark.parametrize("name", NAMES)
def test_begins_and_ends_in_hover(name: str) -> None:
    vehicle = FLEET[name]
    path = setpoint((3.0, 5.0, 2.0), (-1.0, 0.5, 4.0))
    for t, load in ((0.0, (-1.0, 0.5, 4.0)), (float(path["ramp_time"][0]) + 0.02, (3.0, 5.0, 2.0))):
        state, wrench = flat(vehicle, path, t)
        expected = np.zeros(STATE_SIZE)
        expected[LOAD_POSITION] = load
        expected[VEHICLE_POSITION] = np.add(load, (0.0, 0.0, vehicle.hover_length))
        np.testing.assert_allclose(state[:12], expected[:12], atol=1e-6)
        # Differences reach across the joint of the path, where its seventh derivative jumps.
        np.testing.assert_allclose(state[BODY_RATES], 0.0, atol=0.01)
        np.testing.assert_allclose(state[EULER_ANGLES], 0.0, atol=1e-5)
        np.testing.assert_allclose(wrench, [vehicle.hover_thrust, 0, 0, 0], atol=1e-4 * vehicle.hover_thrust)


def test_thrust_is_led() -> None:
    vehicle, path = FLEET["large"], PATHS["V.B"]
    lead = 0.01
    times = np.linspace(0.2, 5.0, 20)
    now, led, later = (
        np.array([flat(vehicle, path, t + shift, ahead)[1][0] for t in times])
        for shift, ahead in ((0.0, 0.0), (0.0, lead), (lead, 0.0))
    )
    assert np.abs(led - later).max() < 0.05 * np.abs(later - now).max()
