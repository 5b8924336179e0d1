"""What the description gets wrong is found in flight, and the motion goes on as if it had been right."""

from __future__ import annotations

import numpy as np
import pytest

import sitl
from controller.design.catalogue import design
from controller.design.motion.ramp import planned
from controller.law.adaptation import LEAST, MOST
from controller.law.allocation import MOST_ROTORS, allocation
from controller.law.control_law import WORK, engaged_memory
from controller.law.control_step import control_step
from controller.law.reference import setpoint
from controller.law.state import LOAD_POSITION, STATE_SIZE, Array
from sitl.flights.scenario import Scenario, Setpoint
from sitl.studies.random_vehicles import random_vehicle
from sitl_bridge.plant.physics.world import World
from sitl_bridge.vehicle.description import Vehicle
from tests.controller.coordinates import paper_state
from tests.controller.fleet import FLEET

HEAVY = ["load.mass=11", "cable.stiffness=80", "cable.damping=5"]
LIGHT = ["load.mass=9", "cable.stiffness=120", "cable.damping=5"]


def other(vehicle: Vehicle, mass: float, stiffness: float, damping: float) -> Vehicle:
    """The vehicle with so many times the load's mass, the cable's stiffness and damping."""
    cable = vehicle.cable.model_copy(
        update={
            "stiffness": vehicle.cable.stiffness * stiffness,
            "damping": vehicle.cable.damping * damping,
        }
    )
    load = vehicle.load.model_copy(update={"mass": vehicle.load.mass * mass})
    return vehicle.model_copy(update={"cable": cable, "load": load})


def found(told: Vehicle, flown: Vehicle, target: tuple[float, float, float], seconds: float) -> Array:
    """What the law knows of load mass, stiffness and damping, less 1, at each tick: (n, 3)."""
    world = World(flown, 250.0, seed=0)
    estimate, controls = np.zeros(STATE_SIZE), np.zeros(MOST_ROTORS)
    memory = engaged_memory(paper_state(world.state).real[LOAD_POSITION])
    path = planned(setpoint(target, (0.0, 0.0, 0.0)), told)
    law = (design("default", told, 250.0), allocation(told), path, memory, np.zeros(1, dtype=WORK))
    step = control_step.bind(*law, estimate, controls)
    out = []
    for _ in range(round(seconds * 250.0)):
        estimate[:] = paper_state(world.state).real
        step()
        out.append(memory["adaptation"]["found"][0].copy())
        world.command(tuple(controls.tolist()))
        world.advance(world.steps_per_tick)
    return np.array(out)


@pytest.mark.parametrize("length", [1.0, 10.0])
@pytest.mark.parametrize("wrong", [HEAVY, LIGHT], ids=["heavy", "light"])
def test_the_papers_step_with_another_load_and_cable(length: float, wrong: list[str]) -> None:
    flight = sitl.fly(overrides=[f"cable.rest_length={length}"], plant_overrides=wrong, duration_s=12.0)
    two_percent, centimetre = (2.2, 2.8) if length == 1.0 else (3.1, 3.5)
    assert flight.summary["settling_time_2pct_s"] <= two_percent
    assert flight.summary["settling_time_1cm_s"] <= centimetre
    assert flight.summary["overshoot_pct"] < 0.5


@pytest.mark.parametrize("wrong", [[], HEAVY, LIGHT], ids=["nominal", "heavy", "light"])
@pytest.mark.parametrize(
    ("scenario", "length"), [("circle", 1.0), ("circle", 10.0), ("figure-eight", 10.0), ("helix", 1.0)]
)
def test_paths_with_another_load_and_cable(scenario: str, length: float, wrong: list[str]) -> None:
    flight = sitl.fly(
        scenario, overrides=[f"cable.rest_length={length}"], plant_overrides=wrong, duration_s=16.0
    )
    load = np.stack([flight.states[f"load_{axis}_m"] for axis in "xyz"], axis=1)
    errors = np.linalg.norm(load - flight.reference, axis=1)[flight.states["time_s"] >= 12.0]
    assert np.sqrt(np.mean(errors**2)) < 1e-3


@pytest.mark.parametrize(
    "name", ["paper", "paper, 10 m", "small, lag", "tiny, heavy load", "large, lag", "long"]
)
def test_it_finds_what_is_there(name: str) -> None:
    told = FLEET[name]
    wrong = (1.1, 0.85, 0.6)
    last = found(told, other(told, *wrong), (3.0, 5.0, 2.0), 6.0)[-1]
    np.testing.assert_allclose(last[:2], np.array(wrong[:2]) - 1.0, atol=0.02)
    # A damper is found as far as the cable stretches.
    assert wrong[2] - 1.1 < last[2] < 0.0 or last[2] == pytest.approx(wrong[2] - 1.0, abs=0.1)


def test_nothing_is_found_where_nothing_is_wrong() -> None:
    for name in ("paper", "small, drag", "large, lag"):
        known = found(FLEET[name], FLEET[name], (3.0, 5.0, 2.0), 5.0)
        assert np.abs(known[:, :2]).max() < 0.015
        assert np.abs(known[:, 2]).max() < 0.15


def test_it_does_not_believe_everything() -> None:
    """What is used is bounded, whatever the plant is."""
    told = FLEET["paper"]
    known = found(told, other(told, 1.6, 2.5, 1.0), (0.0, 0.0, 0.0), 4.0)
    assert (known >= LEAST).all()
    assert (known <= MOST).all()


@pytest.mark.parametrize("number", range(12))
def test_random_vehicles_with_other_loads_and_cables(number: int) -> None:
    draw = np.random.default_rng(7_000_000 + number)
    told = random_vehicle(draw, 50.0)
    wrong = draw.uniform((0.8, 0.7, 0.4), (1.2, 1.3, 1.6))
    target = draw.uniform((-30.0, -30.0, -10.0), (30.0, 30.0, 10.0))
    described = Scenario(
        vehicle="paper", reference=Setpoint(kind="setpoint", position=tuple(target.tolist()))
    )
    mass, stiffness, damping = wrong.tolist()
    flight = sitl.fly(
        described,
        vehicle=told,
        plant_overrides=[
            f"load.mass={told.load.mass * mass!r}",
            f"cable.stiffness={told.cable.stiffness * stiffness!r}",
            f"cable.damping={told.cable.damping * damping!r}",
        ],
        duration_s=25.0,
        feedback="truth",
    )
    assert flight.summary["outcome"] == "settled"
    way = np.abs(target).max()
    load = np.stack([flight.states[f"load_{axis}_m"] for axis in "xyz"], axis=1)
    beyond = ((load - target) * np.sign(target)).max()
    assert beyond < 0.05 * way
