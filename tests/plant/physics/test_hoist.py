"""Gripper and winch: rates, limits and stall of the drum, energy that it brings in, release and pick-up."""

import math
from typing import Any

import numpy as np
import pytest

from sitl_bridge.plant.physics.dynamics import set_rotors
from sitl_bridge.plant.physics.state import CABLE_HOLDS, LOAD_POSITION, MOST_ROTORS, VEHICLE_POSITION
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle
from sitl_bridge.vehicle.physics import physics_faults
from tests.plant.flying import Flight, energy, plain_vehicle

G = 9.81
WINCH = {"min_length": 0.4, "max_length": 2.0, "rate": 0.5, "time_constant": 0.1, "stall_tension": 200.0}


def command(plant: Flight, *controls: float) -> None:
    """Gripper, winch and clutch; the rotors stay as they are."""
    everything = np.zeros(MOST_ROTORS)
    everything[4 : 4 + len(controls)] = controls
    set_rotors.bind(plant.record, everything, np.ones(MOST_ROTORS), np.zeros(MOST_ROTORS))()


def rest_length(plant: Flight) -> float:
    return float(plant.record["rest_length"][0])


def with_hoist(**changes: Any) -> Vehicle:
    return plain_vehicle(**{"winch": WINCH, "gripper": {"reach": 0.3, "release_time": 0.2}, **changes})


def test_the_drum_follows_its_command_with_a_lag() -> None:
    plant = Flight(with_hoist())
    start = rest_length(plant)
    command(plant, 0.0, 1.0)
    plant.run(0.5)
    expected = 0.5 * (0.5 - 0.1 * (1.0 - math.exp(-5.0)))
    assert rest_length(plant) - start == pytest.approx(expected, rel=2e-2)
    assert plant.record["reel_rate"][0] == pytest.approx(0.5 * (1.0 - math.exp(-5.0)), rel=1e-6)


@pytest.mark.parametrize(("way", "end"), [(1.0, 2.0), (-1.0, 0.4)])
def test_the_drum_stops_at_the_ends_of_its_range(way: float, end: float) -> None:
    plant = Flight(with_hoist())
    command(plant, 0.0, way)
    plant.run(6.0)
    assert rest_length(plant) == end
    assert plant.record["reel_rate"][0] == 0.0


def test_reeling_in_adds_tension_times_rate_to_the_energy() -> None:
    """Whirling freely about each other, undamped: what the bodies gain is what the motor has done."""
    vehicle = with_hoist(
        cable={"damping": 0.0, "stiffness": 300.0}, initial={"load_velocity": [5.0, 0.0, 0.0]}
    )
    plant = Flight(vehicle)
    command(plant, 0.0, -0.6)
    work, step = 0.0, 1e-4
    before = _energy(plant)
    for _ in range(4000):
        power = _tension(plant) * -float(plant.record["reel_rate"][0])
        plant.run(step, step)
        work += 0.5 * step * (power + _tension(plant) * -float(plant.record["reel_rate"][0]))
    gained = _energy(plant) - before
    assert work > 0.5  # J: pulled in against the centrifugal force
    assert gained == pytest.approx(work, rel=1e-3)


def _tension(plant: Flight) -> float:
    length = float(np.linalg.norm(plant.x[LOAD_POSITION] - plant.x[VEHICLE_POSITION]))
    return max(0.0, plant.vehicle.cable.stiffness * (length - rest_length(plant)))


def _energy(plant: Flight) -> float:
    """J; the spring's part by the rest length of now."""
    cable = plant.vehicle.cable
    length = float(np.linalg.norm(plant.x[LOAD_POSITION] - plant.x[VEHICLE_POSITION]))
    described = max(0.0, length - cable.rest_length)
    now = max(0.0, length - rest_length(plant))
    return float(energy(plant.vehicle, plant.x)) + 0.5 * cable.stiffness * (now**2 - described**2)


def test_more_than_the_stall_tension_is_not_reeled_in() -> None:
    plant = Flight(with_hoist(winch={**WINCH, "stall_tension": 1.0}))
    held = plant.x.copy()
    held[2] += 0.1  # the cable is stretched well beyond the stall tension
    command(plant, 0.0, -1.0)
    start = rest_length(plant)
    for _ in range(300):
        plant.x[:] = held
        plant.run(1e-3)
    assert rest_length(plant) == start


def test_an_open_clutch_pays_out_in_proportion_to_the_tension() -> None:
    plant = Flight(with_hoist(winch={**WINCH, "stall_tension": 50.0}))
    held = plant.x.copy()
    tension = _tension(plant)
    assert 0.0 < tension < 50.0
    command(plant, 0.0, 0.0, -1.0)
    plant.x[:] = held
    plant.run(1e-3)
    expected = 0.5 * tension / 50.0 * (1.0 - math.exp(-0.01))
    assert plant.record["reel_rate"][0] == pytest.approx(expected, rel=1e-3)
    command(plant, 0.0, 0.0, 1.0)
    plant.run(2.0)
    assert plant.record["reel_rate"][0] == 0.0


def test_the_load_is_free_after_the_release_time_and_taken_up_within_reach() -> None:
    plant = Flight(with_hoist())
    start = plant.x.copy()
    command(plant, -1.0)
    plant.run(0.19)
    assert plant.inner[CABLE_HOLDS] == 1.0
    plant.run(0.02)
    assert plant.inner[CABLE_HOLDS] == 0.0
    plant.x[:] = start
    plant.x[2] += 1.0  # the hook is a metre above the load
    command(plant, 1.0)
    plant.run(0.01)
    assert plant.inner[CABLE_HOLDS] == 0.0
    plant.x[:] = start
    plant.x[2] = plant.x[LOAD_POSITION][2] + rest_length(plant) - 0.1
    plant.run(0.01)
    assert plant.inner[CABLE_HOLDS] == 1.0


@pytest.mark.parametrize("nothing", [0.0, math.nan, 0.4, -0.4])
def test_what_is_no_command_changes_nothing(nothing: float) -> None:
    plant, other = Flight(with_hoist()), Flight(with_hoist())
    command(plant, nothing, 0.0, nothing)
    plant.run(0.5)
    other.run(0.5)
    assert plant.x.tobytes() == other.x.tobytes()
    assert plant.inner.tobytes() == other.inner.tobytes()


def test_a_broken_cable_takes_no_load() -> None:
    plant = Flight(with_hoist())
    plant.inner[CABLE_HOLDS] = 0.0
    command(plant, 1.0)
    plant.run(0.01)
    assert plant.inner[CABLE_HOLDS] == 0.0


def test_shipped_vehicles_have_both_and_fly_as_without_when_nothing_is_commanded() -> None:
    for name in ("iris", "heavy"):
        vehicle = load_vehicle(name, ["initial.start=hover"])
        assert vehicle.gripper is not None
        assert vehicle.winch is not None
        bare = vehicle.model_copy(update={"gripper": None, "winch": None})
        plant, other = Flight(vehicle), Flight(bare)
        for flight in (plant, other):
            flight.command[:] = flight.inner[:MOST_ROTORS]
            flight.run(1.0)
        assert plant.x.tobytes() == other.x.tobytes()


def test_more_rotors_than_leave_controls_to_a_hoist_are_refused() -> None:
    vehicle = load_vehicle("iris", [])
    crowd = vehicle.model_copy(update={"rotors": vehicle.rotors * 4})
    (fault,) = [f for f in physics_faults(crowd, Vehicle.model_fields) if "actuator controls" in f.text]
    assert fault.location == ("rotors",)
