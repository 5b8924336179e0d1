"""Motions of the paper's vehicle that theory knows: hover, fall, bounce, pendulum; and RK4's order."""

import math
from itertools import pairwise

import numpy as np
import pytest

from sitl_bridge.plant.physics import dynamics
from sitl_bridge.plant.physics.parameters import parameters
from sitl_bridge.plant.physics.state import LOAD_POSITION, VEHICLE_POSITION, initial_state
from sitl_bridge.vehicle.description import Vehicle, hover_rotor_speed
from sitl_bridge.vehicle.files import load_vehicle
from tests.plant.physics.stepping import Array, arrays, fields, fly, padded, rotor_speeds


def hover(vehicle: Vehicle, duration: float, every: int = 1) -> Array:
    """States from the description's start with hover thrust."""
    speeds = [hover_rotor_speed(vehicle)] * 4
    return fly(parameters(vehicle), initial_state(vehicle), speeds, duration, every=every)


def crossings(time: Array, signal: Array) -> Array:
    """Times at which a signal goes up through zero, by cubic interpolation, s."""
    found = []
    for index in np.flatnonzero((signal[:-1] < 0) & (signal[1:] >= 0)):
        around = slice(index - 1, index + 3)
        found.append(np.interp(0.0, *cubic(signal[around], time[around])))
    return np.array(found)


def cubic(signal: Array, time: Array) -> tuple[Array, Array]:
    """A cubic through four points, as a fine table (signal, time)."""
    fine = np.linspace(time[1], time[2], 1001)
    return np.polynomial.Polynomial.fit(time, signal, 3)(fine), fine


@pytest.mark.parametrize("overrides", [[], ["cable.rest_length=10"], ["cable.model=tension-only"]])
def test_paper_at_equilibrium_stays_there(overrides: list[str]) -> None:
    vehicle = load_vehicle("paper", overrides)
    states = hover(vehicle, 60.0, every=1000)
    np.testing.assert_allclose(states, np.tile(states[0], (61, 1)), rtol=0, atol=1e-10)


def test_without_thrust_both_fall() -> None:
    """From the rest length, where the cable carries nothing."""
    vehicle = load_vehicle("paper", ["initial.vehicle_position=[0, 0, 1]"])
    states = fly(parameters(vehicle), initial_state(vehicle), [0.0] * 4, 10.0)
    drop = -0.5 * 9.81 * (np.arange(len(states)) * 1e-3) ** 2
    np.testing.assert_allclose(states[:, 15], drop, rtol=0, atol=1e-9)
    np.testing.assert_allclose(states[:, 2] - states[:, 15], 1.0, rtol=0, atol=1e-9)


@pytest.mark.parametrize("damping", [0.0, 10.0, 60.0])
@pytest.mark.parametrize("masses", [(10.0, 10.0), (6.0, 9.0)])
def test_bounce_of_two_masses_on_a_spring(damping: float, masses: tuple[float, float]) -> None:
    """On the vertical the cable's length is a linear oscillator of the reduced mass: closed form."""
    vehicle = load_vehicle(
        "paper",
        [
            f"cable.damping={damping}",
            f"airframe.mass={masses[0]}",
            f"load.mass={masses[1]}",
            "initial.vehicle_position=[0, 0, 2.5]",
        ],
    )
    states = hover(vehicle, 10.0)
    stretch = states[:, 2] - states[:, 15] - vehicle.hover_length
    time = np.arange(len(states)) * 1e-3

    reduced = masses[0] * masses[1] / sum(masses)
    natural = math.sqrt(100.0 / reduced)
    ratio = damping / (2 * math.sqrt(100.0 * reduced))
    damped = natural * np.sqrt(complex(1 - ratio**2))
    expected = (
        np.exp(-ratio * natural * time)
        * (np.cos(damped * time) + ratio * natural / damped * np.sin(damped * time)).real
    )
    np.testing.assert_allclose(stretch / stretch[0], expected, rtol=0, atol=1e-9)
    # The common centre of mass rests.
    centre = (masses[0] * states[:, 2] + masses[1] * states[:, 15]) / sum(masses)
    np.testing.assert_allclose(centre, centre[0], rtol=0, atol=1e-10)


def test_bounce_of_paper_in_figures() -> None:
    """Table I: 4.472 rad/s undamped, ratio 0.2236, so 4.359 rad/s and a decrement of 1.4415."""
    vehicle = load_vehicle("paper", ["initial.vehicle_position=[0, 0, 2.5]"])
    states = hover(vehicle, 10.0)
    stretch = states[:, 2] - states[:, 15] - vehicle.hover_length
    time = np.arange(len(states)) * 1e-3
    times = crossings(time, stretch)
    assert np.diff(times) == pytest.approx(2 * math.pi / math.sqrt(20 - 1), rel=1e-6)
    peaks = [stretch[(time > a) & (time < b)].max() for a, b in pairwise(times[:4])]
    decrements = [math.log(one / other) for one, other in pairwise(peaks)]
    assert decrements == pytest.approx([2 * math.pi / math.sqrt(19)] * 2, rel=1e-5)


@pytest.mark.parametrize("rest_length", [1.0, 10.0])
@pytest.mark.parametrize("masses", [(10.0, 10.0), (6.0, 9.0)])
def test_pendulum_of_vehicle_and_load(rest_length: float, masses: tuple[float, float]) -> None:
    """Both swing about their common centre: ω² = (1 + m_p / m_v) g / l, at small angles (1e-3 rad)."""
    vehicle = load_vehicle(
        "paper",
        [
            f"cable.rest_length={rest_length}",
            f"airframe.mass={masses[0]}",
            f"load.mass={masses[1]}",
        ],
    )
    length = vehicle.hover_length
    start = initial_state(vehicle)
    start[LOAD_POSITION.start] = 1e-3 * length
    states = fly(parameters(vehicle), start, [hover_rotor_speed(vehicle)] * 4, 20.0)
    across = states[:, LOAD_POSITION.start] - states[:, VEHICLE_POSITION.start]
    times = crossings(np.arange(len(states)) * 1e-3, across)
    expected = 2 * math.pi / math.sqrt((1 + masses[1] / masses[0]) * 9.81 / length)
    assert len(times) >= 3
    assert np.diff(times) == pytest.approx(expected, rel=1e-6)


# A case that moves everything: bounce, swing and an attitude that turns about unequal axes.
BUSY = [
    "airframe.inertia=[0.1, 0.2, 0.25]",
    "initial.vehicle_position=[0.9, -0.5, 1.7]",
    "initial.body_rates=[1.5, 0.7, -0.4]",
    "initial.attitude=[0.2, -0.1, 1]",
]


def test_rk4_is_of_fourth_order() -> None:
    vehicle = load_vehicle("paper", BUSY)
    record, start = parameters(vehicle), initial_state(vehicle)
    speeds = rotor_speeds(vehicle, vehicle.hover_thrust, (0.05, -0.03, 0.02))

    def end(step: float) -> Array:
        return np.asarray(fly(record, start, speeds, 2.0, step=step, every=round(2.0 / step))[-1])

    exact = end(2.5e-4)
    errors = np.array([np.abs(end(step) - exact) for step in (0.02, 0.01, 0.005)])
    assert errors[-1].max() > 1e-10  # above rounding
    assert errors[0].max() < 1e-2  # and small enough for the order to show
    order = np.log2(errors[:-1].max(axis=1) / errors[1:].max(axis=1))
    assert order == pytest.approx([4.0, 4.0], abs=0.2)
    # Every part of the state converges so: vehicle, attitude, rates, load.
    for part in (slice(0, 6), slice(6, 10), slice(10, 13), slice(13, 19)):
        ratio = np.linalg.norm(errors[1, part]) / np.linalg.norm(errors[2, part])
        assert math.log2(ratio) == pytest.approx(4.0, abs=0.3)


def test_compiled_and_plain_python_agree() -> None:
    vehicle = load_vehicle("paper", BUSY)
    record = parameters(vehicle)
    speeds = rotor_speeds(vehicle, vehicle.hover_thrust, (0.05, -0.03, 0.02))
    force = np.array([1.0, -2.0, 0.5, 0.3, 0.2, -0.1])
    compiled = fly(record, initial_state(vehicle), speeds, 0.2, every=200, force=force)[-1]
    plain = initial_state(vehicle)
    dynamics.advance.python(*arrays([fields(record)], plain, speeds, force[None]), 0, 0, 200, 200, 200, 1e-3)
    np.testing.assert_allclose(compiled, plain, rtol=1e-13, atol=1e-14)


def test_held_forces_are_read_row_by_row() -> None:
    """Row k acts from step k·hold_steps on, wherever a call starts."""
    vehicle = load_vehicle("paper")
    generator = np.random.default_rng(3)
    forces = generator.normal(size=(dynamics.TABLE_ROWS, 6))
    record, speeds = parameters(vehicle), padded([hover_rotor_speed(vehicle)] * 4)
    one, two = initial_state(vehicle), initial_state(vehicle)
    after = 0
    for steps in (4, 3, 10, 1, 22):
        after += dynamics.advance(*arrays(record, one, speeds, forces), after, after, 10, 10, steps, 1e-3)
    assert after == 40
    for row in range(4):
        held = np.tile(forces[row], (dynamics.TABLE_ROWS, 1))
        dynamics.advance(*arrays(record, two, speeds, held), 0, 0, 10, 10, 10, 1e-3)
    np.testing.assert_array_equal(one, two)
