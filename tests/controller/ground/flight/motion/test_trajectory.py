"""Motions to the targets of ground control: smooth, within their limits, and where they ought to end."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from scipy import signal

from controller.design.catalogue import guided_designs
from controller.ground.flight.motion.setpoint_types import Body, Follow, Goto, Land
from controller.ground.flight.motion.trajectory import (
    FASTEST_POLE,
    MOST_JERK,
    Limits,
    Trajectory,
    motion_pole,
    stopping_distance,
)
from controller.law.allocation import MOST_ROTORS, allocation
from controller.law.control_law import WORK, engaged_memory
from controller.law.control_step import control_step
from controller.law.reference import DERIVATIVES
from controller.law.state import LOAD_POSITION, STATE_SIZE, Array
from tests.controller.fleet import FLEET

PERIOD = 0.004
LIMITS = Limits(acceleration=2.0, total=4.0, speed=6.0, up=2.0, down=1.5)
NAN3 = (math.nan, math.nan, math.nan)


def moved(trajectory: Trajectory, target: Goto | Land | Follow, duration: float) -> Array:
    """The motion (n, 6, 3) that a target makes."""
    rows = []
    for k in range(round(duration / PERIOD)):
        trajectory.advance(target, LIMITS, k * PERIOD)
        rows.append(trajectory.path["motion"][0].copy())
    return np.array(rows)


def started(velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Trajectory:
    trajectory = Trajectory(PERIOD)
    trajectory.start(np.zeros(3), np.array(velocity), 0.0)
    return trajectory


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (2.0, -1.0, 0.5)])
def test_each_derivative_is_the_derivative_of_the_one_before(velocity: tuple[float, float, float]) -> None:
    motion = moved(started(velocity), Goto(Body.LOAD, (5.0, 3.0, 1.0), 0.0, 2.0), 8.0)
    for order in range(4):
        change = (motion[2:, order] - motion[:-2, order]) / (2 * PERIOD)
        scale = np.abs(motion[:, order + 1]).max()
        np.testing.assert_allclose(motion[1:-1, order + 1], change, atol=0.01 * scale)
    np.testing.assert_allclose(motion[0, 0], np.array(velocity) * PERIOD, atol=1e-4)


def test_it_arrives_without_passing_the_point_and_keeps_the_limits() -> None:
    motion = moved(started(), Goto(Body.LOAD, (10.0, 0.0, 0.0), 0.0, 3.0), 12.0)
    np.testing.assert_allclose(motion[-1, 0], (10.0, 0.0, 0.0), atol=0.01)
    assert motion[:, 0, 0].max() < 10.01
    assert motion[:, 1, 0].max() < 3.0 * 1.02
    assert np.abs(motion[:, 2, 0]).max() < 2.0 * 1.05
    climb = moved(started(), Goto(Body.LOAD, (0.0, 0.0, 10.0), 0.0, 6.0), 5.0)
    assert climb[:, 1, 2].max() == pytest.approx(2.0, rel=0.02)


def test_a_velocity_is_reached_and_kept_and_a_landing_has_no_end() -> None:
    follow = Follow(Body.LOAD, NAN3, (1.5, 0.0, -0.5), NAN3, math.nan, math.nan)
    np.testing.assert_allclose(moved(started(), follow, 5.0)[-1, 1], (1.5, 0.0, -0.5), atol=1e-3)
    sinking = moved(started(), Land(Body.VEHICLE, (0.0, 0.0, 0.0), 0.0, 0.5), 10.0)
    np.testing.assert_allclose(sinking[-1, 1], (0.0, 0.0, -0.5), atol=1e-3)
    assert sinking[-1, 0, 2] < -4.0


def test_a_trajectory_of_set_points_is_followed_without_lag() -> None:
    """A circle of 2 m in 12 s, given at 20 Hz with velocity and acceleration."""
    trajectory, w = started(), 2.0 * math.pi / 12.0
    errors = []
    for message in range(20 * 24):
        t = message / 20.0
        c, s = math.cos(w * t), math.sin(w * t)
        follow = Follow(
            Body.LOAD,
            (2.0 * c, 2.0 * s, 0.0),
            (-2.0 * w * s, 2.0 * w * c, 0.0),
            (-2.0 * w * w * c, -2.0 * w * w * s, 0.0),
            math.nan,
            math.nan,
        )
        for _ in range(12 if message % 2 else 13):  # 12.5 ticks in the mean
            trajectory.advance(follow, LIMITS, 0.0)
        end = t + 0.05
        place = trajectory.path["motion"][0, 0]
        errors.append(math.hypot(place[0] - 2 * math.cos(w * end), place[1] - 2 * math.sin(w * end)))
    assert max(errors[20 * 12 :]) < 0.03


def sharpest(order: int) -> float:
    """Largest derivative of a motion whose carrot changes its acceleration from one limit to the other.

    The motion's transfer function from the carrot's acceleration is p^5 s^(order - 2) / (s + p)^5.
    """
    numerator = [FASTEST_POLE**DERIVATIVES, *[0.0] * (order - 2)]
    system = signal.TransferFunction(numerator, np.poly([-FASTEST_POLE] * DERIVATIVES))
    _, response = signal.step(system, T=np.linspace(0.0, 4.0, 4001))
    return float(2.0 * LIMITS.acceleration * np.abs(response).max())


def test_a_set_point_that_moves_already_is_joined_within_the_limits() -> None:
    """From rest onto a trajectory at 2 m/s: as sharply as the acceleration limit makes it, and no sharper."""
    trajectory = started()
    moved(trajectory, Follow(Body.LOAD, (0.0, 0.0, 0.0), NAN3, NAN3, 0.0, math.nan), 0.5)
    rows = []
    for message in range(200):
        along = Follow(Body.LOAD, (2.0 * message / 20.0, 0.0, 0.0), (2.0, 0.0, 0.0), NAN3, math.nan, math.nan)
        rows.append(moved(trajectory, along, 0.052 if message % 2 else 0.048))
    motion = np.concatenate(rows)
    assert np.abs(motion[:, 2]).max() < LIMITS.acceleration * 1.001
    for order in (3, 4):
        assert np.abs(motion[:, order]).max() < sharpest(order) * 1.001
    np.testing.assert_allclose(motion[-1, 0], (20.0, 0.0, 0.0), atol=0.02)
    np.testing.assert_allclose(motion[-1, 1], (2.0, 0.0, 0.0), atol=0.02)


@pytest.mark.parametrize("seed", range(12))
def test_whatever_set_points_jump_about_the_motion_stays_smooth_and_bounded(seed: int) -> None:
    """The limit is on what set-points ask for and what it takes to get there, both together."""
    chance, trajectory, longest = random.Random(seed), started(), 80

    def vector(reach: float) -> tuple[float, float, float]:
        x, y, z = (chance.choice((math.nan, -reach, 0.0, chance.uniform(-reach, reach))) for _ in range(3))
        return (x, y, z)

    rows = [trajectory.path["motion"][0].copy()]
    for _ in range(15):
        follow = Follow(Body.LOAD, vector(30.0), vector(6.0), vector(6.0), math.nan, 0.3)
        rows.extend(moved(trajectory, follow, chance.randint(1, longest) * PERIOD))
    rows.extend(moved(trajectory, Goto(Body.LOAD, (0.0, 0.0, 0.0), 0.0, 3.0), 2.0))
    motion = np.array(rows)
    grown = math.sqrt(3.0) * MOST_JERK * longest * PERIOD  # between one set-point and the next
    assert np.linalg.norm(motion[:, 2], axis=1).max() < LIMITS.total + grown
    for order in range(4):
        step = np.abs(np.diff(motion[:, order], axis=0)).max()
        assert step <= PERIOD * np.abs(motion[:, order + 1]).max() * 1.01 + 1e-9


def test_it_stops_where_the_stopping_distance_says() -> None:
    trajectory = started((3.0, 0.0, 0.0))
    there = stopping_distance(3.0, LIMITS.acceleration)
    motion = moved(trajectory, Goto(Body.LOAD, (there, 0.0, 0.0), 0.0, 3.0), 10.0)
    assert motion[:, 0, 0].max() < there + 0.01
    assert motion[:, 1, 0].min() > -0.01
    assert motion[-1, 0, 0] == pytest.approx(there, abs=0.01)


def test_yaw_turns_the_short_way_and_no_faster_than_it_may() -> None:
    trajectory = started()
    trajectory.start(np.zeros(3), np.zeros(3), 3.0)
    rates = []
    for k in range(1500):
        trajectory.advance(Goto(Body.LOAD, (0.0, 0.0, 0.0), -3.0, 1.0), LIMITS, k * PERIOD)
        rates.append(float(trajectory.path["yaw_rate"][0]))
    assert float(trajectory.path["yaw"][0]) == pytest.approx(-3.0, abs=1e-3)
    assert min(rates) > -0.01  # from 3 on over pi
    assert max(rates) <= 0.6


@pytest.mark.parametrize("law", [0, 1], ids=["load", "vehicle"])
def test_a_law_that_looks_elsewhere_does_the_same(law: int) -> None:
    """Everything turned about the vertical, heading and all: the rotors' commands are the same."""
    vehicle = FLEET["small, lag"]
    design = guided_designs(vehicle, 250.0)[law]
    commands = []
    for turn in (0.0, 1.1, -2.9):
        c, s = math.cos(turn), math.sin(turn)
        turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        trajectory = Trajectory(PERIOD)
        trajectory.start(np.zeros(3), turned @ (1.0, 0.5, 0.1), turn)
        estimate, controls = np.zeros(STATE_SIZE), np.zeros(MOST_ROTORS)
        x = np.array([0.1, 0.2, vehicle.hover_length, 0.3, -0.1, 0.2, 0.5, 0.4, -0.1, 0.2, 0.3, 0.1])
        for i in range(0, 12, 3):
            estimate[i : i + 3] = turned @ x[i : i + 3]
        estimate[12:18] = (0.1, -0.2, 0.05, 0.04, -0.03, turn + 0.02)
        memory = engaged_memory(estimate[LOAD_POSITION])
        step = control_step.bind(
            design, allocation(vehicle), trajectory.path, memory, np.zeros(1, dtype=WORK), estimate, controls
        )
        goto = Goto(Body.LOAD, tuple((turned @ (2.0, 1.0, 0.0)).tolist()), turn, 2.0)
        for k in range(250):
            trajectory.advance(goto, LIMITS, k * PERIOD)
            step()
        commands.append(controls[:4].copy())
    np.testing.assert_allclose(commands[1], commands[0], rtol=1e-6)
    np.testing.assert_allclose(commands[2], commands[0], rtol=1e-6)


@pytest.mark.parametrize("length", [0.5, 1.55, 8.0, 20.0, 50.0])
def test_the_vehicles_share_of_a_reversal_stays_small_on_any_cable(length: float) -> None:
    """The vehicle accelerates by the load's acceleration and l/g times its snap, however long the cable."""
    pole = motion_pole(length, 9.81)
    trajectory = Trajectory(PERIOD, pole)
    trajectory.start(np.zeros(3), np.zeros(3), 0.0)
    there, back = (Goto(Body.LOAD, (x, 0.0, 5.0), 0.0, LIMITS.speed) for x in (20.0, -20.0))
    worst = 0.0
    for k in range(round(40.0 / PERIOD)):
        target = there if k * PERIOD < 8.0 else back
        trajectory.advance(target, LIMITS, k * PERIOD)
        motion = trajectory.path["motion"][0]
        worst = max(worst, abs(float(motion[2, 0] + length / 9.81 * motion[4, 0])))
    assert worst < 3.0 * LIMITS.acceleration


FLOOR = 1.0


def anything(chance: random.Random) -> Goto | Follow:
    """A target above or below the floor, whose parts need not fit each other."""
    place = (chance.uniform(-20, 20), chance.uniform(-20, 20), chance.uniform(-5, 8))
    if chance.random() < 0.3:
        return Goto(Body.LOAD, place, 0.0, chance.uniform(0.5, 6))
    velocity, acceleration = (
        tuple(math.nan if chance.random() < 0.3 else reach * chance.uniform(-1, 1) for reach in reaches)
        for reaches in ((6.0, 6.0, 1.5), (4.0, 4.0, 4.0))
    )
    position = (*place[:2], math.nan if chance.random() < 0.5 else place[2])
    return Follow(Body.LOAD, position, velocity, acceleration, 0.0, math.nan)  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(20))
def test_no_target_takes_the_motion_below_the_floor(seed: int) -> None:
    chance = random.Random(seed)
    trajectory = Trajectory(PERIOD)
    trajectory.start(np.array((0.0, 0.0, 4.0)), np.zeros(3), 0.0)
    limits = LIMITS._replace(floor=FLOOR)
    lowest = math.inf
    for _ in range(30):
        target = anything(chance)
        for k in range(chance.randrange(1, 400)):
            trajectory.advance(target, limits, k * PERIOD)
            lowest = min(lowest, float(trajectory.path["motion"][0, 0, 2]))
    assert lowest > FLOOR - 0.02


def test_a_floor_does_not_hold_up_a_landing_or_a_climb_from_below() -> None:
    limits = LIMITS._replace(floor=FLOOR)
    down, up = started(), started()
    for k in range(2000):
        down.advance(Land(Body.LOAD, (0.0, 0.0, 0.0), 0.0, 0.5), limits, k * PERIOD)
        up.advance(Goto(Body.LOAD, (0.0, 0.0, 3.0), 0.0, 2.0), limits, k * PERIOD)
    assert down.path["motion"][0, 0, 2] < -2.0
    assert up.path["motion"][0, 0, 2] == pytest.approx(3.0, abs=0.02)


@pytest.mark.parametrize(("way", "most"), [(8.0, LIMITS.up), (-8.0, LIMITS.down)])
def test_a_set_point_that_climbs_or_sinks_itself_is_closed_to_within_the_same_limit(
    way: float, most: float
) -> None:
    """Its own velocity and what closes the gap to it are limited together."""
    own = math.copysign(0.6 * most, way)
    trajectory, fastest = started(), 0.0
    for k in range(1500):
        if k % 25 == 0:
            place = (0.0, 0.0, way + own * k * PERIOD)
            target = Follow(Body.LOAD, place, (0.0, 0.0, own), NAN3, 0.0, math.nan)
        trajectory.advance(target, LIMITS, k * PERIOD)
        fastest = max(fastest, abs(float(trajectory.path["motion"][0, 1, 2])))
    assert 0.95 * most < fastest < 1.01 * most
