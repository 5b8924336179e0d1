"""Ropes of a material: loss factor, energy, slack, order of convergence, bounce against theory."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import root_scalar

from sitl_bridge.plant.physics.cables.flexible_cable import progressive_tension, strain_without_tension
from sitl_bridge.plant.physics.parameters import parameters
from sitl_bridge.plant.physics.state import (
    CABLE_HOLDS,
    CABLE_STATE,
    LOAD_POSITION,
    LOAD_VELOCITY,
    TENSION,
    VEHICLE_VELOCITY,
)
from sitl_bridge.vehicle.cable_law import (
    BRANCH_SPEEDS,
    BRANCHES,
    bounce_rate,
    branches,
    cable_law,
    linear_cable,
)
from sitl_bridge.vehicle.cable_materials import MATERIALS
from sitl_bridge.vehicle.description import Vehicle, hover_rotor_speeds
from tests.plant.flying import Array, Flight, plain_vehicle
from tests.plant.physics.stepping import fields

materials = pytest.mark.parametrize("material", list(MATERIALS))


def on_rope(material: str = "nylon", **changes: Any) -> Vehicle:
    """Two bodies on a rope; `changes` by table."""
    rope = {"model": "progressive", "material": material, **changes.pop("cable", {})}
    return plain_vehicle(cable=rope, **changes)


class Rope:
    """A rope alone, pulled along a path of strain."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.law = cable_law(vehicle)
        self.p: SimpleNamespace = fields(parameters(vehicle))
        self.memory = np.zeros(BRANCHES)

    def relaxed_at(self, strain: float) -> None:
        self.memory[:] = max(strain, 0.0)

    def pull(self, strains: Array, step: float) -> tuple[Array, Array]:
        """Tension, N, and energy stored, J a metre of rope, at each strain, `step` seconds apart."""
        tensions, stored = np.zeros(len(strains)), np.zeros(len(strains))
        for index, strain in enumerate(strains):
            if index > 0:  # branches exactly, with the strain linear in between
                before = max(strains[index - 1], strain_without_tension(self.p, self.memory, 0))
                middle = 0.5 * (before + max(strain, before if strain < before else strain))
                self.memory += (middle - self.memory) * -np.expm1(-step * self.p.branch_rate)
            tensions[index] = progressive_tension(self.p, strain, self.memory, 0)
            material = max(strain, strain_without_tension(self.p, self.memory, 0))
            stored[index] = self.energy(material)
        return tensions, stored

    def energy(self, strain: float) -> float:
        """J stored in a metre: the static curve's, and each branch's."""

        def work(at: Any) -> Any:
            return self.law.scale * (np.expm1(self.law.rate * at) / self.law.rate - at)

        held = self.memory
        pulls = self.law.scale * np.expm1(self.law.rate * held)
        parts = work(strain) - work(held) - pulls * (strain - held)
        return float(work(strain) + np.sum(self.p.branch_weight * parts))


@materials
@pytest.mark.parametrize("speed", [0.1, 1.0, 2.0])
def test_measured_loss_factor_is_the_one_told(material: str, speed: float) -> None:
    """Energy lost in a cycle over 2 pi times the energy stored; speed: over the bounce frequency."""
    vehicle = on_rope(material)
    rope = Rope(vehicle)
    weight = vehicle.load.mass * vehicle.gravity
    mean, omega = rope.law.strain(weight), speed * bounce_rate(vehicle, rope.law)
    amplitude = 1e-3 * mean
    rope.memory[:] = mean + amplitude * np.imag(1.0 / (1.0 + 1j * omega / rope.p.branch_rate))  # swung in
    a_cycle, cycles = 1000, 2
    phase = 2 * math.pi * np.arange(a_cycle * cycles + 1) / a_cycle
    strains = mean + amplitude * np.sin(phase)
    tensions, _ = rope.pull(strains, 2 * math.pi / omega / a_cycle)
    last = slice(-a_cycle - 1, None)
    lost = np.trapezoid(tensions[last], strains[last])
    in_phase = 2 * np.mean((tensions[last][:-1] - weight) * np.sin(phase[last][:-1])) / amplitude
    measured = lost / (math.pi * in_phase * amplitude**2)
    assert measured == pytest.approx(rope.law.loss_factor, rel=0.03)
    if speed == 1.0:
        assert measured == pytest.approx(rope.law.loss_factor, rel=5e-3)
        assert in_phase / vehicle.cable.rest_length == pytest.approx(
            linear_cable(vehicle).stiffness, rel=5e-3
        )


@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from(list(MATERIALS)),
    st.floats(-0.5, 1.0),
    st.lists(st.tuples(st.floats(-0.5, 0.5), st.floats(0.05, 5.0)), min_size=1, max_size=3),
)
def test_a_rope_never_pushes_and_never_gives_energy(
    material: str, mean: float, waves: list[tuple[float, float]]
) -> None:
    """Whatever is done to it: what was put in is stored or lost, and what is lost only grows."""
    rope = Rope(on_rope(material))
    unit = 0.5 * MATERIALS[material].breaking_strain  # type: ignore[index]
    times = np.linspace(0.0, 3.0, 3001)
    strains = unit * mean + unit * sum(a * np.sin(2 * math.pi * f * times) for a, f in waves)
    rope.relaxed_at(float(strains[0]))
    tensions, stored = rope.pull(strains, times[1])
    put_in = np.concatenate([[0.0], np.cumsum(0.5 * (tensions[1:] + tensions[:-1]) * np.diff(strains))])
    lost = put_in - (stored - stored[0])
    assert tensions.min() >= 0.0
    assert stored.min() >= -1e-12 * (1.0 + stored.max())
    scale = max(stored.max(), np.abs(put_in).max(), 1e-12)
    assert np.min(lost - np.maximum.accumulate(lost)) >= -2e-4 * scale


@pytest.mark.parametrize("loss_factor", [0.001, 0.02, 0.1, 0.2, 0.3])
def test_loss_factor_holds_around_the_bounce(loss_factor: float) -> None:
    found = branches(loss_factor)
    assert np.all(found.weights >= 0.0)
    speeds = 10.0 ** np.linspace(-1.5, 0.5, 60)
    x = speeds[:, None] / BRANCH_SPEEDS
    stiffness = 1.0 + np.sum(found.weights * 1j * x / (1.0 + 1j * x), axis=1)
    np.testing.assert_allclose(stiffness.imag / stiffness.real, loss_factor, rtol=0.12)


@materials
def test_bounce_about_hover_against_theory(material: str) -> None:
    """Frequency and decay are those of the root of m s² + k(s) = 0, k the rope's complex stiffness."""
    vehicle = on_rope(material)
    plant = Flight(vehicle)
    plant.command[:4] = plant.inner[:4] = hover_rotor_speeds(vehicle)
    law = cable_law(vehicle)
    rate, weight = bounce_rate(vehicle, law), vehicle.load.mass * vehicle.gravity
    hover = vehicle.hover_length
    np.testing.assert_allclose(np.diff(plant.path(0.5, 0.1), axis=0), 0.0, atol=1e-9)  # it hangs at rest
    plant.x[LOAD_POSITION.start + 2] -= 1e-3 * (hover - vehicle.cable.rest_length)
    every = 0.02 / rate
    states = plant.path(20.0 / rate, every, every / 4)
    stretch = states[:, 2] - states[:, 15] - hover
    reduced = 1.0 / (1.0 / vehicle.airframe.mass + 1.0 / vehicle.load.mass)
    found, static = branches(law.loss_factor).weights, law.tangent(weight) / vehicle.cable.rest_length

    def stiffness(s: complex) -> complex:
        return static * (1.0 + complex(np.sum(found * s / (s + rate * BRANCH_SPEEDS))))

    s = 1j * rate
    for _ in range(60):
        s = 1j * np.sqrt(stiffness(s) / reduced)
    turns = np.flatnonzero((stretch[1:-1] - stretch[:-2]) * (stretch[2:] - stretch[1:-1]) < 0.0) + 1
    tops, times = np.abs(np.diff(stretch[turns])), turns * every
    decay = np.log(tops[0] / tops[-1]) / (times[-2] - times[0])
    frequency = math.pi * (len(turns) - 1) / (times[-1] - times[0])
    assert frequency == pytest.approx(s.imag, rel=0.01)
    assert decay == pytest.approx(-s.real, rel=0.04)


@materials
def test_order_of_convergence_is_four_while_taut(material: str) -> None:
    vehicle = on_rope(material, initial={"load_velocity": [0.5, 0.2, -0.1], "body_rates": [0.3, -0.2, 0.1]})
    rate = bounce_rate(vehicle, cable_law(vehicle))
    ends = []
    for steps in (128, 256, 512):
        plant = Flight(vehicle)
        plant.command[:4] = plant.inner[:4] = hover_rotor_speeds(vehicle)
        plant.run(6.4 / rate, 6.4 / rate / steps)
        assert plant.reactions[TENSION] > 0.0
        ends.append(plant.x.copy())
    errors = [np.linalg.norm(ends[i] - ends[i + 1]) for i in range(2)]
    assert math.log2(errors[0] / errors[1]) > 3.7


@materials
def test_snatches_lose_energy_and_keep_momentum(material: str) -> None:
    """Vehicle and load falling freely, the load thrown about on its rope."""
    vehicle = on_rope(
        material,
        cable={"diameter": 0.02 if material == "rubber" else 0.002},
        initial={"vehicle_position": [0.0, 0.0, 0.9], "load_velocity": [1.0, 0.3, -2.0]},
    )
    plant = Flight(vehicle)
    plant.inner[:4] = 0.0
    rope = Rope(vehicle)
    masses = vehicle.airframe.mass, vehicle.load.mass

    def energy() -> float:
        rope.memory[:] = plant.inner[CABLE_STATE : CABLE_STATE + BRANCHES]
        x = plant.x
        strain = math.dist(x[13:16], x[0:3]) / vehicle.cable.rest_length - 1.0
        material_strain = max(strain, strain_without_tension(rope.p, rope.memory, 0))
        return (
            0.5 * masses[0] * np.sum(x[VEHICLE_VELOCITY] ** 2)
            + 0.5 * masses[1] * np.sum(x[LOAD_VELOCITY] ** 2)
            + vehicle.gravity * (masses[0] * x[2] + masses[1] * x[15])
            + vehicle.cable.rest_length * rope.energy(material_strain)
        )

    energies, tensions = [energy()], []
    for _ in range(300):
        plant.run(0.01, 5e-5)
        energies.append(energy())
        tensions.append(plant.reactions[TENSION])
    assert plant.inner[CABLE_HOLDS] == 1.0
    assert min(tensions) == 0.0 < max(tensions)
    moving = 0.5 * masses[0] * masses[1] / sum(masses) * 5.0
    assert np.max(np.diff(energies)) < 1e-5 * moving
    assert energies[-1] < energies[0]
    momentum = masses[0] * plant.x[VEHICLE_VELOCITY] + masses[1] * plant.x[LOAD_VELOCITY]
    start = masses[1] * np.array([1.0, 0.3, -2.0])
    np.testing.assert_allclose(momentum, start - [0.0, 0.0, sum(masses) * 9.81 * 3.0], atol=1e-9)


@materials
def test_static_curve_and_breaking_load(material: str) -> None:
    """The curve passes through the breaking load at the breaking strain; there the rope breaks."""
    vehicle = on_rope(material, cable={"diameter": 0.02 if material == "rubber" else 0.001})
    law, figures = cable_law(vehicle), MATERIALS[material]  # type: ignore[index]
    assert law.tension(figures.breaking_strain) == pytest.approx(law.breaking_load)
    half = root_scalar(
        lambda e: law.tension(e) - 0.5 * law.breaking_load, bracket=[0.0, figures.breaking_strain]
    )
    assert law.strain(0.5 * law.breaking_load) == pytest.approx(half.root)
    plant = Flight(vehicle)
    plant.inner[CABLE_STATE : CABLE_STATE + BRANCHES] = figures.breaking_strain
    plant.x[:3] = 0.0, 0.0, vehicle.cable.rest_length * (1.0 + 1.01 * figures.breaking_strain)
    plant.run(1e-6, 1e-6)
    assert plant.inner[CABLE_HOLDS] == 0.0
