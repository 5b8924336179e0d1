"""The fastest motion to a set-point: how fast it is, what it keeps to, and how well it is flown."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.optimize import minimize

from controller.design.catalogue import design
from controller.design.motion.fastest import fastest
from controller.design.motion.limits import limits_of
from controller.design.motion.ramp import demand, planned
from controller.design.motion.straight_line import StraightLine
from controller.law.reference import DERIVATIVES, Path, feasible, setpoint
from controller.law.state import Array
from sitl.studies.random_vehicles import random_vehicle
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.closed_loop import fly
from tests.controller.fleet import FLEET, attributes

ORIGIN = (0.0, 0.0, 0.0)
TARGET = (3.0, 5.0, 2.0)


def to(target: tuple[float, ...], vehicle: Vehicle, agility: float = 0.7) -> Path:
    path = setpoint(target, ORIGIN)  # type: ignore[arg-type]
    path["agility"] = agility
    return planned(path, vehicle)


def at(path: Path, t: float) -> Array:
    out = np.zeros((DERIVATIVES + 1, 3))
    feasible(attributes(path), t, out, np.zeros(DERIVATIVES + 1))
    return out


@pytest.mark.parametrize(("length", "two_percent", "centimetre"), [(1.0, 2.0, 2.3), (10.0, 3.0, 3.4)])
def test_the_papers_step(length: float, two_percent: float, centimetre: float) -> None:
    vehicle = load_vehicle("paper", [f"cable.rest_length={length}"])
    path = to(TARGET, vehicle)
    flight = fly(vehicle, design("default", vehicle, 250.0), path, 20.0, 250.0)
    metrics = flight.metrics
    assert metrics["settling_time_2pct_s"] is not None
    assert metrics["settling_time_2pct_s"] <= two_percent
    assert metrics["settling_time_1cm_s"] is not None
    assert metrics["settling_time_1cm_s"] <= centimetre
    assert metrics["overshoot_pct"] is not None
    assert metrics["overshoot_pct"] < 0.1
    assert not flight.limited.any()
    reference = np.array([at(path, t)[0] for t in flight.times.tolist()])
    load = flight.states[:, 3:6]
    assert np.linalg.norm(load - reference, axis=1).max() < 1e-3


@pytest.mark.parametrize("vehicle", FLEET.values(), ids=FLEET)
def test_more_agility_takes_less_time(vehicle: Vehicle) -> None:
    times = [float(to(TARGET, vehicle, agility)["ramp_time"][0]) for agility in (0.0, 0.35, 0.7, 1.0)]
    assert all(faster < slower for slower, faster in itertools.pairwise(times))


@pytest.mark.parametrize("vehicle", FLEET.values(), ids=FLEET)
def test_rest_is_left_and_reached_with_every_derivative(vehicle: Vehicle) -> None:
    path = to(TARGET, vehicle)
    duration = float(path["ramp_time"][0])
    for t, place in ((0.0, ORIGIN), (duration * (1.0 - 1e-9), TARGET)):
        motion = at(path, t)
        np.testing.assert_allclose(motion[0], place, atol=1e-9)
        np.testing.assert_allclose(motion[1:], 0.0, atol=1e-5)


@pytest.mark.parametrize("vehicle", FLEET.values(), ids=FLEET)
def test_pieces_join_with_every_derivative(vehicle: Vehicle) -> None:
    path = to(TARGET, vehicle)
    duration, pieces = float(path["ramp_time"][0]), int(path["pieces"][0])
    scale = np.abs([at(path, t) for t in np.linspace(0.0, duration, 200)]).max(axis=(0, 2))
    for joint in range(1, pieces):
        t = duration * joint / pieces
        jump = np.abs(at(path, t + 1e-7) - at(path, t - 1e-7)).max(axis=1)
        assert (jump < 1e-5 * scale + 1e-9).all()


def test_the_same_step_is_planned_the_same() -> None:
    assert to(TARGET, FLEET["paper"]).tobytes() == to(TARGET, FLEET["paper"]).tobytes()


def test_a_direction_does_not_matter() -> None:
    """Rotors at the corners of a square are the same to the east as to the north."""
    times = [float(to(way, FLEET["paper"])["ramp_time"][0]) for way in ((5, 0, 1), (0, 5, 1), (-5, 0, 1))]
    assert times == pytest.approx([times[0]] * 3, rel=2e-3)


@pytest.mark.parametrize("number", range(4))
def test_near_the_minimum_of_a_finer_search(number: int) -> None:
    """A program of its own, with a spline of more pieces and another solver, finds nothing much faster."""
    draw = np.random.default_rng(number)
    vehicle = random_vehicle(draw)
    way = draw.normal(size=3) * (1.0, 1.0, 0.3)
    way *= math.exp(draw.uniform(math.log(2.0), math.log(50.0))) / np.linalg.norm(way)
    path = to(tuple(way.tolist()), vehicle)
    assert path["ramp_time"][0] <= 1.35 * offline_minimum(vehicle, path)


def offline_minimum(vehicle: Vehicle, path: Path) -> float:
    """The shortest duration, s, that SLSQP finds along the same line, within the same limits."""
    line = StraightLine(vehicle, path["centre"][0] - path["start"][0], limits_of(vehicle))
    degree, pieces, samples = 7, 32, 129
    knots = np.concatenate([np.zeros(degree), np.linspace(0.0, 1.0, pieces + 1), np.ones(degree)])
    count = pieces + degree
    times = np.linspace(0.0, 1.0, samples)
    spline = BSpline(knots, np.eye(count), degree)
    columns = np.stack([spline(times), *(spline.derivative(k)(times) for k in range(1, 5))])
    inner = columns[:, :, degree:-degree]
    ends = columns[:, :, -degree:].sum(axis=2)

    duration = float(path["ramp_time"][0])
    feasible_ones = [duration]

    def room(x: Array) -> Array:
        left = -line.excess(inner @ x[:-1] + ends, float(x[-1]))[:, ::2]
        if left.min() > -0.02:
            feasible_ones.append(float(x[-1]))
        return np.asarray(left).ravel()

    share = path["centre"][0] - path["start"][0]
    places = np.array([(at(path, t)[0] - path["start"][0]) @ share for t in duration * times]) / (
        share @ share
    )
    begin, *_ = np.linalg.lstsq(inner[0], places - ends[0], rcond=None)
    minimize(
        lambda x: x[-1],
        np.array([*begin, duration]),
        jac=lambda x: np.eye(len(x))[-1],
        method="SLSQP",
        constraints={"type": "ineq", "fun": room},
        bounds=[(-5.0, 5.0)] * len(begin) + [(0.3 * duration, duration)],
        options={"maxiter": 40},
    )
    assert len(feasible_ones) > 1
    return min(feasible_ones)


def test_a_vertical_step() -> None:
    vehicle = FLEET["paper"]
    for climb in (-8.0, 8.0):
        path = to((0.0, 0.0, climb), vehicle)
        duration = float(path["ramp_time"][0])
        asked = demand(path, vehicle, duration, np.linspace(0.0, duration, 1001))
        limits = limits_of(vehicle)
        assert asked.tilt < 1e-6
        assert asked.thrust <= limits.most_thrust * 1.01
        assert asked.tension >= 0.99 * limits.tension * vehicle.load.mass * vehicle.gravity


def test_no_step_takes_no_plan() -> None:
    path = to(ORIGIN, FLEET["paper"])
    assert path["pieces"][0] == 0
    np.testing.assert_allclose(at(path, 1.0), 0.0)


def test_nothing_is_faster_than_the_shortest_step() -> None:
    vehicle = FLEET["paper"]
    line = StraightLine(vehicle, np.array([1e-3, 0.0, 0.0]), limits_of(vehicle))
    assert fastest(line, 0.8).duration == 0.8
