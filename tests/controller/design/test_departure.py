"""From a start that is not at rest: what the load does at first, and the motion that takes it to rest."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.design.catalogue import design
from controller.design.motion.departure import JOINED, begins_as_described, departing, first_moment
from controller.design.motion.limits import limits_of
from controller.design.motion.prepared import PreparedMotion
from controller.design.motion.ramp import demand, planned
from controller.law.reference import DERIVATIVES, Path, circle, feasible, setpoint
from controller.law.state import EULER_ANGLES, LOAD_POSITION, VEHICLE_POSITION, Array
from sitl.studies.paper import offline
from sitl.studies.paper.analysis.quiet import NEAR, overrides, quiet_after
from sitl_bridge.plant.physics.world import World
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.closed_loop import fly
from tests.controller.fleet import attributes

RATE = 250.0
TARGET = (3.0, 5.0, 2.0)


def starting(*overrides: str, length: str = "1") -> Vehicle:
    return load_vehicle("paper", [f"cable.rest_length={length}", *overrides])


def aslant(degrees: float, length: str, *more: str) -> Vehicle:
    reach, angle = starting(length=length).hover_length, math.radians(degrees)
    place = [reach * math.sin(angle), 0.0, reach * math.cos(angle)]
    return starting(f"initial.vehicle_position={place}", *more, length=length)


STARTS = {
    "20 degrees": aslant(20.0, "1"),
    "20 degrees, 10 m": aslant(20.0, "10"),
    "rest length": starting("initial.vehicle_position=[0, 0, 1]"),
    "in motion": starting(
        "initial.load_velocity=[0.5, -0.3, 0.1]", "initial.vehicle_velocity=[-0.2, 0.4, 0.2]"
    ),
    "leaning": starting("initial.attitude=[0.1, -0.2, 0.0]"),
    "rotors that lag": aslant(15.0, "3", *(f"rotors.{i}.time_constant=0.05" for i in range(4))),
}


def from_start(vehicle: Vehicle, target: tuple[float, float, float] | None = None) -> Path:
    at = vehicle.initial_load_position
    return departing(planned(setpoint(target or at, at), vehicle), vehicle)


@pytest.mark.parametrize("vehicle", STARTS.values(), ids=STARTS)
def test_the_first_moment_is_what_the_plant_does_by_itself(vehicle: Vehicle) -> None:
    derivatives = first_moment(vehicle)
    world = World(vehicle, 2000.0, seed=0)
    world.command(world.trim_controls)
    for _ in range(100):
        world.advance(world.steps_per_tick)
    after = 0.05
    series = sum(derivatives[k] * after**k / math.factorial(k) for k in range(JOINED))
    moved = np.subtract(offline.eq31(world.state)[3:6], vehicle.initial_load_position)
    np.testing.assert_allclose(series - derivatives[0], moved, atol=2e-3 * np.linalg.norm(moved) + 1e-7)


@pytest.mark.parametrize("vehicle", STARTS.values(), ids=STARTS)
def test_the_motion_begins_as_the_load_and_ends_at_rest(vehicle: Vehicle) -> None:
    path = from_start(vehicle, TARGET)
    assert path["departs"][0] == 1
    out: Array = np.zeros((DERIVATIVES + 1, 3))
    feasible(attributes(path), 0.0, out, np.zeros(DERIVATIVES + 1))
    np.testing.assert_allclose(out, first_moment(vehicle)[: DERIVATIVES + 1], rtol=1e-6, atol=1e-6)
    duration = float(path["ramp_time"][0])
    feasible(attributes(path), duration * (1.0 - 1e-9), out, np.zeros(DERIVATIVES + 1))
    np.testing.assert_allclose(out[0], TARGET, atol=1e-9)
    np.testing.assert_allclose(out[1:4], 0.0, atol=1e-6)


@pytest.mark.parametrize("vehicle", STARTS.values(), ids=STARTS)
def test_it_keeps_the_limits(vehicle: Vehicle) -> None:
    path, limits = from_start(vehicle), limits_of(vehicle)
    duration = float(path["ramp_time"][0])
    asked = demand(path, vehicle, duration, np.linspace(0.0, duration, 1500))
    assert asked.tilt < 1.02 * limits.tilt
    assert asked.thrust < 1.02 * limits.most_thrust


@pytest.mark.parametrize("law", ["default", "geometric"])
@pytest.mark.parametrize(
    ("start", "length", "within"),
    [("swing", "1", 2.15), ("swing", "10", 4.3), ("rest_length", "1", 2.15), ("rest_length", "10", 2.15)],
)
def test_load_and_cable_are_quiet_in_half_the_papers_time(
    start: str, length: str, within: float, law: str
) -> None:
    """The paper's law takes 4.3 s, and turns over when it begins with a swing on 10 m."""
    vehicle = load_vehicle("paper", [*overrides(start, length)])
    flight = fly(vehicle, design(law, vehicle, RATE), from_start(vehicle), 10.0, RATE)
    load = flight.states[:, LOAD_POSITION]
    after = quiet_after(
        flight.times, flight.states[:, VEHICLE_POSITION], load, np.tile(load[0], (len(load), 1))
    )
    assert after < within
    assert not flight.limited.any()


@pytest.mark.parametrize("vehicle", STARTS.values(), ids=STARTS)
def test_the_feedback_has_next_to_nothing_to_catch(vehicle: Vehicle) -> None:
    """On the way to a set-point, too."""
    path = from_start(vehicle, TARGET)
    flight = fly(vehicle, design("default", vehicle, RATE), path, float(path["ramp_time"][0]) + 3.0, RATE)
    out: Array = np.zeros((DERIVATIVES + 1, 3))
    away = []
    for time, state in zip(flight.times[::10], flight.states[::10], strict=True):
        feasible(attributes(path), float(time), out, np.zeros(DERIVATIVES + 1))
        away.append(np.linalg.norm(state[LOAD_POSITION] - out[0]))
    assert max(away) < 0.02
    assert np.linalg.norm(flight.states[-1][LOAD_POSITION] - TARGET) < NEAR
    assert np.abs(flight.states[:, EULER_ANGLES][:, :2]).max() < math.radians(50.0)


def test_where_there_is_nothing_to_plan_from_the_path_stays() -> None:
    at = (0.0, 0.0, 0.0)
    swinging = STARTS["20 degrees"]
    rest = planned(setpoint(at, at), swinging)
    assert departing(rest, starting()) == rest  # at rest already
    slack = starting("initial.vehicle_position=[0, 0, 0.9]")
    assert departing(rest, slack) == rest
    turning = aslant(20.0, "1", "initial.body_rates=[0.1, 0, 0]")
    assert departing(rest, turning) == rest
    elsewhere = planned(setpoint(at, (0.1, 0.0, 0.0)), swinging)
    assert departing(elsewhere, swinging) == elsewhere
    round_it = planned(circle((0.0, 0.0, 5.0), 5.0, 0.5, at), swinging)
    assert departing(round_it, swinging) == round_it


def test_it_is_flown_from_the_described_start_and_on_truth_only() -> None:
    vehicle = STARTS["20 degrees"]
    at = vehicle.initial_load_position
    estimate = np.array(offline.eq31(World(vehicle, RATE, seed=0).state))
    path = setpoint(TARGET, at)
    assert begins_as_described(vehicle, estimate)
    motion = PreparedMotion(path, vehicle, estimated=False)
    assert motion.planned(path, estimate)["departs"][0] == 1
    other = estimate.copy()
    other[0] += 0.1
    assert not begins_as_described(vehicle, other)
    assert motion.planned(path, other) == planned(path, vehicle)
    assert PreparedMotion(path, vehicle, estimated=True).planned(path, estimate)["departs"][0] == 0
