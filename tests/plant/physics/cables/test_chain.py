"""The chain: catenary, waves, energy, equilibrium, ground, against what theory says."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

from sitl_bridge.plant.physics.cables.chain import NODE_STATES, chain
from sitl_bridge.plant.physics.parameters import LONGEST_STEP, parameters, step_count
from sitl_bridge.plant.physics.state import (
    CABLE_HOLDS,
    CABLE_STATE,
    LOAD_VELOCITY,
    STATE_SIZE,
    TENSION,
    VEHICLE_VELOCITY,
)
from sitl_bridge.vehicle.chain import end_mass
from sitl_bridge.vehicle.description import Vehicle, hover_rotor_speeds
from sitl_bridge.vehicle.files import load_vehicle
from tests.plant.flying import Array, Flight, plain_vehicle
from tests.plant.physics.stepping import fields

FIXED = 1e9
"""kg: a body that a chain does not move."""


def on_chain(segments: int = 8, **changes: Any) -> Vehicle:
    cable = {"model": "chain", "segments": segments, "mass": 0.2, **changes.pop("cable", {})}
    return plain_vehicle(cable=cable, **changes)


def nodes(plant: Flight) -> Array:
    """(n - 1, 6): position and velocity of each, a view."""
    count = plant.vehicle.node_count
    out: Array = plant.inner[CABLE_STATE : CABLE_STATE + NODE_STATES * count].reshape(count, NODE_STATES)
    return out


def between_fixed_points(vehicle: Vehicle, span: float, gravity: float) -> Flight:
    """Both ends held `span` metres apart, level; the nodes on the line between."""
    plant = Flight(vehicle)
    plant.record["vehicle_mass"] = plant.record["load_mass"] = FIXED
    plant.record["gravity"] = gravity
    plant.forces[0, 2] = plant.forces[0, 5] = FIXED * gravity
    plant.inner[:4] = 0.0
    plant.x[:3], plant.x[13:16] = (0.0, 0.0, 10.0), (span, 0.0, 10.0)
    line = np.linspace(0.0, span, vehicle.cable.segments + 1)[1:-1]
    nodes(plant)[:] = 0.0
    nodes(plant)[:, 0], nodes(plant)[:, 2] = line, 10.0
    return plant


def catenary(length: float, span: float, arc: Array) -> Array:
    """Points (n, 2) of a rope without stretch, `arc` metres along it from one of two level ends."""
    a = brentq(lambda a: 2.0 * a * math.sinh(span / (2.0 * a)) - length, 0.05 * span, 1e3 * span)
    lowest = arc - 0.5 * length
    x = a * np.arcsinh(lowest / a)
    return np.column_stack([x + 0.5 * span, a * (np.cosh(x / a) - math.cosh(0.5 * span / a))])


def hanging_error(segments: int) -> float:
    """Largest distance, m, of a node at rest from the catenary, at the same length along it."""
    vehicle = on_chain(segments, cable={"stiffness": 2e4})
    span = 0.7
    plant = between_fixed_points(vehicle, span, 9.81)
    p = fields(parameters(vehicle))
    state = np.zeros(STATE_SIZE + NODE_STATES * vehicle.node_count)
    state[:3], state[13:16] = plant.x[:3], plant.x[13:16]
    expected = catenary(1.0, span, np.arange(1, segments) / segments)

    def accelerations(free: Array) -> Array:
        state[STATE_SIZE:].reshape(-1, NODE_STATES)[:, 0:3:2] = free.reshape(-1, 2)
        rate = np.zeros_like(state)
        chain(p, state, True, np.zeros(6), rate, np.zeros(6))
        out: Array = rate[STATE_SIZE:].reshape(-1, NODE_STATES)[:, 3:6:2].ravel()
        return out

    found = (expected * 1.1 + [0.0, 10.0]).ravel()
    for stiffness in (
        20.0,
        100.0,
        500.0,
        2.5e3,
        2e4,
    ):  # a slack segment has no derivative: from soft to stiff
        p.stiffness = stiffness
        found, _, solved, why = fsolve(accelerations, found, full_output=True, xtol=1e-12)
    assert np.max(np.abs(accelerations(found))) < 1e-6, (solved, why)
    at_rest = found.reshape(-1, 2)
    nodes(plant)[:, 0:3:2] = at_rest
    plant.run(0.2, 0.2 / step_count(vehicle, 0.2))
    np.testing.assert_allclose(nodes(plant)[:, 0:3:2], at_rest, atol=1e-6)  # it stays there
    return float(np.max(np.linalg.norm(at_rest - expected - [0.0, 10.0], axis=1)))


def test_a_chain_at_rest_converges_to_the_catenary() -> None:
    """The error falls with the square of the number of segments."""
    errors = [hanging_error(segments) for segments in (5, 10, 20)]
    assert errors[-1] < 2e-3
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.35)


@pytest.mark.parametrize("axis", [0, 2], ids=["along", "across"])
def test_waves_travel_as_the_wave_equation_says(axis: int) -> None:
    """Half a wave between fixed ends has period 2 L / c, c = sqrt(T / mu) across, sqrt(EA / mu) along."""
    errors = []
    for segments in (5, 10, 20):
        vehicle = on_chain(segments, cable={"stiffness": 400.0})
        span = 1.1
        plant = between_fixed_points(vehicle, span, 0.0)
        line = nodes(plant)[:, 0] / span
        nodes(plant)[:, 3 + axis] = 1e-3 * np.sin(math.pi * line)
        strain_force = 400.0 * 1.0  # EA = k L
        density = 0.2 / (span if axis == 2 else 1.0)  # along the chain as it is, or as it was at rest
        speed = math.sqrt((400.0 * 0.1 if axis == 2 else strain_force) / density)
        period = 2.0 * (span if axis == 2 else 1.0) / speed
        step = period / 2000
        half = 0.0
        middle = []
        for _ in range(1200):
            plant.run(step, step)
            half += step
            middle.append(
                float(nodes(plant)[segments // 2, axis] - (line[segments // 2] * span, 0, 10.0)[axis])
            )
        signs = np.flatnonzero(np.diff(np.sign(middle[10:]))) + 10
        first = signs[0]
        crossing = first + middle[first] / (middle[first] - middle[first + 1]) + 1.0
        errors.append(abs(2.0 * crossing * step / period - 1.0))
    assert errors[-1] < 1.2e-3
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2.0, atol=0.3)


def test_it_hangs_at_rest_and_the_rotors_carry_it() -> None:
    vehicle = on_chain(cable={"damping": 0.5})
    plant = Flight(vehicle)
    plant.command[:4] = plant.inner[:4] = hover_rotor_speeds(vehicle)
    start, hanging = plant.x.copy(), nodes(plant).copy()
    plant.run(1.0, 1.0 / step_count(vehicle, 1.0))
    np.testing.assert_allclose(plant.x, start, atol=1e-10)
    np.testing.assert_allclose(nodes(plant), hanging, atol=1e-10)
    carried = vehicle.load.mass + vehicle.cable_mass - end_mass(vehicle)
    assert plant.reactions[TENSION] == pytest.approx(carried * vehicle.gravity, rel=1e-9)
    assert vehicle.hover_thrust == pytest.approx((2.0 + 0.7 + 0.2) * 9.81)


@pytest.mark.parametrize("damping", [0.0, 0.5])
def test_snatches_never_gain_energy_and_keep_momentum(damping: float) -> None:
    """Vehicle and load falling freely, the load thrown about on the chain."""
    vehicle = on_chain(
        cable={"damping": damping, "drag": 0.0},
        initial={"vehicle_position": [0.0, 0.0, 0.9], "load_velocity": [1.0, 0.3, -2.0]},
    )
    plant = Flight(vehicle)
    plant.inner[:4] = 0.0
    segment_mass = vehicle.cable_mass / vehicle.cable.segments
    ends = np.array([vehicle.airframe.mass, vehicle.load.mass]) + end_mass(vehicle)
    masses = np.array([ends[0], *[segment_mass] * vehicle.node_count, ends[1]])

    def motion() -> tuple[float, Array]:
        own, x = nodes(plant), plant.x
        places = np.vstack([x[:3], own[:, :3], x[13:16]])
        speeds = np.vstack([x[VEHICLE_VELOCITY], own[:, 3:], x[LOAD_VELOCITY]])
        lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
        stretch = np.maximum(lengths - 1.0 / vehicle.cable.segments, 0.0)
        stored = 0.5 * vehicle.cable.stiffness * vehicle.cable.segments * np.sum(stretch**2)
        moving = 0.5 * np.sum(masses * np.sum(speeds**2, axis=1))
        return float(moving + stored + vehicle.gravity * np.sum(masses * places[:, 2])), masses @ speeds

    start, momentum = motion()
    energies = [start]
    for _ in range(100):
        plant.run(0.01, 5e-5)
        energies.append(motion()[0])
    gain = np.max(np.diff(energies))
    assert gain < 2e-4
    if damping == 0.0:
        assert energies[-1] == pytest.approx(start, abs=0.02)
    else:
        assert energies[-1] < start - 0.1
    np.testing.assert_allclose(motion()[1], momentum - [0.0, 0.0, masses.sum() * 9.81], atol=1e-9)


def test_wind_bends_it() -> None:
    """A chain in a side wind sags downwind of the line between its ends; without drag it does not."""
    offsets = []
    for drag in (0.0, 0.02):
        plant = Flight(on_chain(cable={"drag": drag, "damping": 0.5}))
        plant.record["vehicle_mass"] = FIXED
        plant.forces[0, 2] = FIXED * 9.81
        plant.inner[:4] = 0.0
        plant.winds[0] = (8.0, 0.0, 0.0, 8.0, 0.0, 0.0)
        plant.run(0.3, 1e-4)
        offsets.append(float(np.max(nodes(plant)[:, 0])))
    assert offsets[0] == pytest.approx(0.0, abs=1e-9)
    assert offsets[1] > 0.01


def test_steps_by_rule_and_a_chain_that_lets_go() -> None:
    vehicle = on_chain(20, cable={"damping": 1.0})
    assert 0.004 / step_count(vehicle, 0.004) < LONGEST_STEP
    plant = Flight(vehicle)
    plant.inner[CABLE_HOLDS] = 0.0
    plant.run(0.5, 0.5 / step_count(vehicle, 0.5))
    assert np.all(np.isfinite(nodes(plant)))
    assert plant.reactions[TENSION] == 0.0
    line = plant.x[:3] + np.arange(1, 20)[:, None] / 20 * (plant.x[13:16] - plant.x[:3])
    np.testing.assert_allclose(nodes(plant)[:, :3], line, atol=0.05)


def test_it_lies_on_the_ground_while_it_is_slack() -> None:
    vehicle = load_vehicle("iris", ["cable.model=chain", "initial.start=ground"])
    plant = Flight(vehicle)
    plant.run(3.0, 3.0 / step_count(vehicle, 3.0))
    assert vehicle.ground is not None
    heights = nodes(plant)[:, 2] - vehicle.ground.height
    assert np.min(heights) > -0.02
    assert np.max(np.abs(nodes(plant)[:, 3:])) < 0.2
