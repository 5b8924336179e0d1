"""Conservation laws of the equations of motion, for random vehicles anywhere in flight.

Each law is checked twice: at a point, where the derivative has to obey it to rounding, and along a flight,
where RK4 has to keep it to the order of its error.
"""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from scipy.integrate import simpson
from scipy.spatial.transform import Rotation

from sitl_bridge.plant.physics.state import (
    ATTITUDE,
    BODY_RATES,
    LOAD_POSITION,
    LOAD_VELOCITY,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
)
from tests.plant.physics.stepping import STEP, Array, derivative, fly
from tests.plant.physics.vehicles import Case, cases

DURATION = 0.5
STEPS = round(DURATION / STEP)


def rotation(states: Array) -> Array:
    """Body to world, (…, 3, 3)."""
    return np.asarray(Rotation.from_quat(states[..., ATTITUDE], scalar_first=True).as_matrix())


def cable(states: Array) -> tuple[Array, Array, Array]:
    """Length (…), m, its rate, m/s, and direction (…, 3) from vehicle to load."""
    across = states[..., LOAD_POSITION] - states[..., VEHICLE_POSITION]
    length = np.linalg.norm(across, axis=-1)
    along = across / length[..., None]
    rate = np.sum(along * (states[..., LOAD_VELOCITY] - states[..., VEHICLE_VELOCITY]), axis=-1)
    return length, rate, along


def mechanical_energy(case: Case, states: Array) -> Array:
    """Kinetic, potential and elastic energy (…), J."""
    v, length = case.vehicle, cable(states)[0]
    extension = length - v.cable.rest_length
    if v.cable.model == "tension-only":
        extension = np.maximum(extension, 0.0)
    energy: Array = (
        0.5 * v.airframe.mass * np.sum(states[..., VEHICLE_VELOCITY] ** 2, axis=-1)
        + 0.5 * np.sum(np.array(v.airframe.inertia) * states[..., BODY_RATES] ** 2, axis=-1)
        + 0.5 * v.load.mass * np.sum(states[..., LOAD_VELOCITY] ** 2, axis=-1)
        + v.gravity * (v.airframe.mass * states[..., 2] + v.load.mass * states[..., 15])
        + 0.5 * v.cable.stiffness * extension**2
    )
    return energy


def energy_rate(case: Case, state: Array) -> float:
    """Rate of `mechanical_energy`, W: its gradient along the plant's derivative of the state."""
    rate = derivative(case.record, state, case.rotor_speed, case.force)
    v, (length, stretching, _) = case.vehicle, cable(state)
    extension = length - v.cable.rest_length
    if v.cable.model == "tension-only":
        extension = max(extension, 0.0)
    return float(
        v.airframe.mass * state[VEHICLE_VELOCITY] @ rate[VEHICLE_VELOCITY]
        + (np.array(v.airframe.inertia) * state[BODY_RATES]) @ rate[BODY_RATES]
        + v.load.mass * state[LOAD_VELOCITY] @ rate[LOAD_VELOCITY]
        + v.gravity * (v.airframe.mass * rate[2] + v.load.mass * rate[15])
        + v.cable.stiffness * extension * stretching
    )


def rotor_forces(case: Case) -> tuple[float, Array]:
    """Thrust, N, and moment (3,), N m, FLU, of the rotors, from the description."""
    thrust, moment = 0.0, np.zeros(3)
    for rotor, speed in zip(case.vehicle.rotors, case.rotor_speed, strict=True):
        lift = rotor.thrust_coefficient * speed**2
        thrust += lift
        moment += np.cross(rotor.position, (0.0, 0.0, lift))
        moment[2] += rotor.torque_coefficient * speed**2 * (-1 if rotor.direction == "ccw" else 1)
    return thrust, moment


def supplied_power(case: Case, states: Array) -> Array:
    """Power of rotors and external forces (…), W."""
    thrust, moment = rotor_forces(case)
    power: Array = (
        thrust * np.sum(rotation(states)[..., :, 2] * states[..., VEHICLE_VELOCITY], axis=-1)
        + states[..., BODY_RATES] @ moment
        + states[..., VEHICLE_VELOCITY] @ case.force[:3]
        + states[..., LOAD_VELOCITY] @ case.force[3:]
    )
    return power


def flight(case: Case) -> Array:
    return fly(case.record, case.state, case.rotor_speed, DURATION, force=case.force)


def fastest_rate(case: Case, states: Array) -> float:
    """The fastest rate of a flight, 1/s: of spring, damper, attitude and swing."""
    v, (length, _, _) = case.vehicle, cable(states)
    reduced = v.airframe.mass * v.load.mass / (v.airframe.mass + v.load.mass)
    across = states[:, LOAD_VELOCITY] - states[:, VEHICLE_VELOCITY]
    return float(
        max(
            math.sqrt(v.cable.stiffness / reduced),
            v.cable.damping / reduced,
            3 * np.linalg.norm(states[:, BODY_RATES], axis=1).max(),
            3 * (np.linalg.norm(across, axis=1) / length).max(),
        )
    )


def integration_error(case: Case, states: Array) -> float:
    """RK4's relative error over a flight: t·λ·(λh)⁴ / 120 where things change at the rate λ; and rounding.

    Only flights that the step resolves (λh < 0.1), and that keep away from the singular length 0, count.
    """
    rate = fastest_rate(case, states)
    assume(rate * STEP < 0.1)
    assume(cable(states)[0].min() > 0.3)
    return DURATION * rate * (rate * STEP) ** 4 / 120 + 1e-13 * STEPS


@settings(max_examples=60)
@given(cases())
def test_power_goes_where_it_should(case: Case) -> None:
    """Rotors and external forces bring energy in; the damper, and nothing else, takes it out."""
    _, rate, _ = cable(case.state)
    dissipated = case.vehicle.cable.damping * rate**2
    supplied = float(supplied_power(case, case.state))
    scale = 1e3 + abs(supplied) + dissipated
    assert energy_rate(case, case.state) == pytest.approx(supplied - dissipated, abs=1e-11 * scale)


@settings(max_examples=30)
@given(cases())
def test_energy_balance_of_a_flight(case: Case) -> None:
    states = flight(case)
    _, rate, _ = cable(states)
    energy = mechanical_energy(case, states)
    net = supplied_power(case, states) - case.vehicle.cable.damping * rate**2
    # Energy that goes through the flight, as a scale.
    scale = np.ptp(energy) + np.abs(energy).max() + simpson(np.abs(net), dx=STEP)
    error = energy[-1] - energy[0] - simpson(net, dx=STEP)
    # Powers are quadratic, so they change at twice the rate, and Simpson's rule errs by (2λh)⁴ / 180.
    quadrature = (2 * fastest_rate(case, states) * STEP) ** 4 / 180
    assert abs(error) < (10 * integration_error(case, states) + quadrature) * scale


@settings(max_examples=60)
@given(cases())
def test_only_external_forces_change_linear_momentum(case: Case) -> None:
    v = case.vehicle
    rate = derivative(case.record, case.state, case.rotor_speed, case.force)
    momentum_rate = v.airframe.mass * rate[VEHICLE_VELOCITY] + v.load.mass * rate[LOAD_VELOCITY]
    thrust, _ = rotor_forces(case)
    expected = thrust * rotation(case.state)[:, 2] + case.force[:3] + case.force[3:]
    expected[2] -= v.hover_thrust
    np.testing.assert_allclose(momentum_rate, expected, rtol=0, atol=1e-11 * (1e3 + thrust))


@pytest.mark.parametrize("model", ["two-way", "tension-only"])
def test_momentum_of_a_fall_is_exact(model: str) -> None:
    """RK4 keeps a linear invariant to rounding, also where the cable snaps taut."""

    @settings(max_examples=25)
    @given(cases(model=model, powered=False, slack=True))
    def check(case: Case) -> None:
        v, states = case.vehicle, flight(case)
        assume(cable(states)[0].min() > 0.3)
        momentum = v.airframe.mass * states[:, VEHICLE_VELOCITY] + v.load.mass * states[:, LOAD_VELOCITY]
        expected = momentum[0] - np.outer(np.arange(len(states)) * STEP, [0, 0, v.hover_thrust])
        np.testing.assert_allclose(momentum, expected, rtol=0, atol=1e-12 * STEPS)

    check()


@settings(max_examples=25)
@given(cases(powered=False))
def test_angular_momentum_of_a_fall(case: Case) -> None:
    """Without rotors the vehicle's spin is kept, in the world, and the pair's about its common centre."""
    v, states = case.vehicle, flight(case)
    length = cable(states)[0]
    bound = integration_error(case, states)
    spin = np.einsum("nij,nj->ni", rotation(states), np.array(v.airframe.inertia) * states[:, BODY_RATES])
    assert np.abs(spin - spin[0]).max() < 10 * bound * (1e-3 + np.linalg.norm(spin[0]))

    across = states[:, LOAD_POSITION] - states[:, VEHICLE_POSITION]
    across_rate = states[:, LOAD_VELOCITY] - states[:, VEHICLE_VELOCITY]
    orbital = np.cross(across, across_rate)
    scale = length.max() * (1 + np.linalg.norm(across_rate, axis=1).max())
    assert np.abs(orbital - orbital[0]).max() < 10 * bound * scale


@settings(max_examples=25)
@given(cases())
def test_any_flight_converges_with_the_fourth_power_of_the_step(case: Case) -> None:
    """Halving the step divides the error by sixteen, whatever flies; against a step eight times finer."""
    rate = fastest_rate(case, fly(case.record, case.state, case.rotor_speed, 1.0, force=case.force))
    step = 2.0 ** math.floor(math.log2(min(0.2 / rate, 0.02)))

    def end(step: float) -> Array:
        steps = max(1, round(1.0 / step))
        states = fly(case.record, case.state, case.rotor_speed, 1.0, step, steps, case.force)
        return np.asarray(states[-1])

    exact = end(step / 16)
    coarse, fine = (float(np.linalg.norm(end(size) - exact)) for size in (step, step / 2))
    assume(fine > 1e-9)  # above rounding
    assert 3.5 < math.log2(coarse / fine) < 5.0


@settings(max_examples=25)
@given(cases())
def test_quaternion_stays_of_unit_length(case: Case) -> None:
    states = flight(case)
    norms = np.linalg.norm(states[:, ATTITUDE], axis=1)
    np.testing.assert_allclose(norms, 1.0, rtol=0, atol=4e-16)
    rate = derivative(case.record, case.state, case.rotor_speed)
    assert abs(rate[ATTITUDE] @ case.state[ATTITUDE]) < 1e-14


@settings(max_examples=80)
@given(cases(model="tension-only", slack=True))
def test_a_tension_only_cable_never_pushes_and_is_idle_when_slack(case: Case) -> None:
    v, (length, rate, along) = case.vehicle, cable(case.state)
    motion = derivative(case.record, case.state, case.rotor_speed, case.force)
    # Force of the cable on the load: what neither weight nor external force explains.
    force = v.load.mass * (motion[LOAD_VELOCITY] + [0, 0, v.gravity]) - case.force[3:]
    tension = -force @ along
    rounding = 1e-12 * (1e3 + abs(tension))
    np.testing.assert_allclose(force, -tension * along, rtol=0, atol=rounding)
    assert tension > -rounding
    extension = length - v.cable.rest_length
    if extension < 0:
        assert abs(tension) < rounding
        assert energy_rate(case, case.state) == pytest.approx(
            float(supplied_power(case, case.state)), abs=1e-9
        )
    else:
        # Taut it takes energy or none; the spring's share comes back, the rest is heat.
        law = v.cable.stiffness * extension + v.cable.damping * rate
        assert tension == pytest.approx(max(0.0, law), abs=rounding)
        assert (tension - v.cable.stiffness * extension) * rate > -1e-9


def test_a_slack_flight_is_two_free_flights() -> None:
    """Vehicle and load thrown apart on a slack cable: parabolas, until it snaps taut."""

    @settings(max_examples=25)
    @given(cases(model="tension-only", powered=False, slack=True))
    def check(case: Case) -> None:
        states = flight(case)
        assume(cable(states)[0].max() < case.vehicle.cable.rest_length)
        time = np.arange(len(states))[:, None] * STEP
        for position, velocity in ((VEHICLE_POSITION, VEHICLE_VELOCITY), (LOAD_POSITION, LOAD_VELOCITY)):
            fall = -0.5 * case.vehicle.gravity * time**2 * [0, 0, 1]
            expected = states[0, position] + states[0, velocity] * time + fall
            np.testing.assert_allclose(states[:, position], expected, rtol=0, atol=1e-11)

    check()
