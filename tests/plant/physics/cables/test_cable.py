"""The tension-only cable: snatches without energy gain, order of convergence, stiffness, breaking."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl_bridge.plant.physics.parameters import LONGEST_STEP, fastest_rate, step_count
from sitl_bridge.plant.physics.state import (
    CABLE_HOLDS,
    LOAD_POSITION,
    LOAD_VELOCITY,
    TENSION,
    VEHICLE_VELOCITY,
)
from sitl_bridge.vehicle.files import load_vehicle
from tests.plant.flying import Array, Flight, energy, flight, plain_vehicle


def tumbling(
    stiffness: float, damping: float, mass: float, load: float, swing: float, throw: float
) -> Flight:
    """Vehicle and load falling freely, the load thrown about so that the cable snatches again and again."""
    plant = Flight(
        plain_vehicle(
            airframe={"mass": mass},
            load={"mass": load},
            cable={"stiffness": stiffness, "damping": damping},
            initial={
                "vehicle_position": [0.0, 0.0, 0.9],
                "load_velocity": [swing, 0.3, throw],
                "body_rates": [0.5, -1.0, 0.3],
            },
        )
    )
    plant.inner[:4] = 0.0
    return plant


def momentum(plant: Flight, x: Array) -> Array:
    """Linear momentum (…, 3), kg m/s."""
    v = plant.vehicle
    total: Array = v.airframe.mass * x[..., VEHICLE_VELOCITY] + v.load.mass * x[..., LOAD_VELOCITY]
    return total


vehicles = st.tuples(
    st.floats(20.0, 3000.0),
    st.floats(0.5, 20.0),
    st.floats(0.1, 20.0),
    st.floats(-3.0, 3.0),
    st.floats(-5.0, 5.0),
)


@settings(max_examples=40, deadline=None)
@given(vehicles)
def test_undamped_snatches_conserve_energy_and_momentum(case: tuple[float, ...]) -> None:
    stiffness, mass, load, swing, throw = case
    plant = tumbling(stiffness, 0.0, mass, load, swing, throw)
    steps = step_count(plant.vehicle, 0.01)
    states = plant.path(3.0, 0.01, step=0.01 / steps)
    total = energy(plant.vehicle, states)
    scale = 0.5 * (mass * load / (mass + load)) * (swing**2 + throw**2 + 0.09) + 1e-3
    np.testing.assert_allclose(total, total[0], rtol=0, atol=2e-4 * scale + 1e-9 * abs(total).max())
    time = 0.01 * np.arange(len(states))
    expected = momentum(plant, states[0]) + np.outer(time, [0, 0, -9.81 * (mass + load)])
    np.testing.assert_allclose(momentum(plant, states), expected, rtol=0, atol=1e-9 * (mass + load) * 30)


@settings(max_examples=30, deadline=None)
@given(vehicles, st.floats(0.1, 30.0))
def test_damped_snatches_never_gain_energy(case: tuple[float, ...], damping: float) -> None:
    stiffness, mass, load, swing, throw = case
    plant = tumbling(stiffness, damping, mass, load, swing, throw)
    steps = step_count(plant.vehicle, 0.01)
    total = energy(plant.vehicle, plant.path(3.0, 0.01, step=0.01 / steps))
    scale = 0.5 * (mass * load / (mass + load)) * (swing**2 + throw**2 + 0.09) + 1e-3
    assert np.diff(total).max() < 1e-5 * scale + 1e-10 * abs(total).max()


def test_slack_cable_does_no_work() -> None:
    """Two bodies on a slack cable fall like two bodies without one, to the bit."""
    slack, cut = (tumbling(200.0, 5.0, 2.0, 0.7, 0.0, -0.0) for _ in range(2))
    cut.inner[CABLE_HOLDS] = 0.0
    np.testing.assert_array_equal(slack.path(0.2, 0.01), cut.path(0.2, 0.01))


def test_a_cable_whose_damper_outweighs_its_spring_does_not_push() -> None:
    """Longer than its rest length, but closing fast: F = k_a (l - l_0) + c_a dl/dt would be negative."""
    closing, cut = (tumbling(200.0, 30.0, 2.0, 0.7, 0.0, 3.0) for _ in range(2))
    cut.inner[CABLE_HOLDS] = 0.0
    for plant in (closing, cut):
        plant.x[2] = plant.x[15] + 1.1  # the spring alone would pull with 20 N, the damper push with 90 N
        plant.run(0.02)
    assert np.linalg.norm(closing.x[0:3] - closing.x[13:16]) > 1.0
    assert closing.reactions[TENSION] == 0.0
    np.testing.assert_array_equal(closing.x, cut.x)


@pytest.mark.parametrize("damping", [0.0, 4.0])
def test_snatches_converge_with_the_fourth_power_of_the_step(damping: float) -> None:
    """Error of a flight with many changes between slack and taut, against one of finer steps."""

    def end(step: float) -> Array:
        plant = tumbling(400.0, damping, 2.0, 0.7, 0.7, -2.0)
        plant.run(4.0, step)
        return plant.x[LOAD_POSITION].copy()

    exact = end(1.25e-4)
    coarse, fine = (float(np.linalg.norm(end(step) - exact)) for step in (4e-3, 2e-3))
    assert 3.3 < math.log2(coarse / fine) < 5.0


@pytest.mark.parametrize("name", ["paper", "iris", "heavy"])
def test_stiff_cable_bounces_as_theory_says(name: str) -> None:
    """k_a = 1e5 N/m, the step by rule: the load's bounce on the cable has the closed-form frequency."""
    plant = flight(
        name,
        "cable.stiffness=1e5",
        "cable.damping=0",
        "cable.breaking_tension=1e9",
        "initial.start=hover",
    )
    v = plant.vehicle
    reduced = 1.0 / (1.0 / v.airframe.mass + 1.0 / v.load.mass)
    frequency = math.sqrt(v.cable.stiffness / reduced)
    plant.command[:4] = plant.inner[:4]
    amplitude = 0.2 * v.load.mass * v.gravity / v.cable.stiffness
    plant.x[2] += amplitude * reduced / v.airframe.mass
    plant.x[15] -= amplitude * reduced / v.load.mass
    steps = step_count(v, 1e-3)
    states = plant.path(0.5, 1e-3, step=1e-3 / steps)
    stretch = states[:, 2] - states[:, 15] - v.hover_length
    time = 1e-3 * np.arange(len(states))
    np.testing.assert_allclose(stretch, amplitude * np.cos(frequency * time), rtol=0, atol=0.01 * amplitude)


def test_step_rule() -> None:
    """The default cables fly at 1 kHz; a stiffer one gets a shorter step, never a longer one."""
    for name in ("paper", "iris", "heavy"):
        vehicle = load_vehicle(name)
        assert step_count(vehicle, 0.004) == math.ceil(
            0.004 / min(LONGEST_STEP, 0.25 / fastest_rate(vehicle))
        )
        assert step_count(vehicle, 0.004) == 4
    stiff = load_vehicle("iris", ["cable.stiffness=1e5"])
    assert step_count(stiff, 0.004) > 4
    assert 0.004 / step_count(stiff, 0.004) * fastest_rate(stiff) <= 0.25


def test_cable_breaks_once_and_for_all() -> None:
    plant = flight("iris", "initial.start=hover", "cable.breaking_tension=4")
    plant.command[:4] = plant.inner[:4]
    plant.run(0.5)
    assert plant.inner[CABLE_HOLDS] == 1.0
    assert plant.reactions[TENSION] == pytest.approx(0.3 * 9.81, rel=1e-6)
    plant.forces[0, 5] = -3.0
    plant.run(1.0)
    assert plant.inner[CABLE_HOLDS] == 0.0
    plant.forces[0, 5] = 0.0
    before = plant.x.copy()
    plant.x[15] = plant.x[2] - 1.6  # as stretched as before, but there is no cable
    plant.run(0.001)
    assert plant.reactions[TENSION] == 0.0
    assert plant.x[18] < before[18]


def test_sudden_load_on_a_slack_cable_doubles_the_static_stretch() -> None:
    """A load let go at the rest length stretches an undamped cable by 2 m g / k."""
    plant = Flight(
        plain_vehicle(
            airframe={"mass": 700.0},
            cable={"stiffness": 100.0},
            initial={"vehicle_position": [0, 0, 1.0]},
        )
    )
    plant.command[:4] = plant.inner[:4]
    plant.forces[0, 2] = -0.7 * 9.81  # the thrust of hover carries the load too, at first for nothing
    depth = plant.path(0.4, 0.001)[:, 15].min()
    assert depth == pytest.approx(-2.0 * 0.7 * 9.81 / 100.0, rel=2e-3)
