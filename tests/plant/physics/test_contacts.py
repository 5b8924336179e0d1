"""The kernels of the ground by themselves, as plain Python: forces of contacts, and where they stick."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sitl_bridge.plant.physics import ground
from sitl_bridge.plant.physics.parameters import parameters
from sitl_bridge.plant.physics.state import (
    ANCHOR_EAST,
    ANCHOR_NORTH,
    ATTITUDE,
    BODY_RATES,
    INNER_SIZE,
    LOAD_CONTACT,
    STATE_SIZE,
    VEHICLE_VELOCITY,
    Array,
)
from sitl_bridge.vehicle.description import Ground
from tests.plant.flying import plain_vehicle
from tests.plant.physics.stepping import fields

LEGS = [(0.3, 0.2, -0.25), (-0.35, 0.25, -0.2), (-0.3, -0.2, -0.3), (0.25, -0.3, -0.25), (0.05, 0.4, -0.2)]
HEIGHT = 2.0
"""m ENU, of the ground"""
VEHICLE = plain_vehicle(
    airframe={"mass": 2.0, "legs": LEGS},
    load={"radius": 0.05},
    cable={"rest_length": 2.0},
    ground={"sink": 0.004, "friction": 0.6, "height": HEIGHT},
    initial={"start": "ground", "load_position": [1.0, 0.5, HEIGHT]},
)
P = fields(parameters(VEHICLE))


def in_the_ground(depth: float = 0.02, lean: float = 0.15) -> tuple[Array, Array]:
    """State and inner state of a vehicle that leans and turns, some legs in the ground, none at rest."""
    x, inner = np.zeros(STATE_SIZE), np.zeros(INNER_SIZE)
    x[0:3] = 1.0, -2.0, HEIGHT + 0.25 - depth
    x[VEHICLE_VELOCITY] = 0.05, -0.04, -0.03
    x[ATTITUDE] = Rotation.from_euler("ZYX", (0.7, lean, -lean / 2)).as_quat(scalar_first=True)
    x[BODY_RATES] = 0.1, -0.2, 0.3
    arms = np.array(LEGS) @ turned(x).T
    offsets = np.random.default_rng(3).normal(0.0, 2e-4, (len(LEGS), 2))
    inner[ANCHOR_EAST : ANCHOR_EAST + len(LEGS)] = x[0] + arms[:, 0] + offsets[:, 0]
    inner[ANCHOR_NORTH : ANCHOR_NORTH + len(LEGS)] = x[1] + arms[:, 1] + offsets[:, 1]
    return x, inner


def turned(x: Array) -> Array:
    return np.asarray(Rotation.from_quat(x[ATTITUDE], scalar_first=True).as_matrix())


def expected_wrench(x: Array, inner: Array) -> tuple[Array, list[str]]:
    """Force (world) and moment (body) on the vehicle (6,), and what each leg does."""
    rotation, force, moment, how = turned(x), np.zeros(3), np.zeros(3), []
    for index, leg in enumerate(LEGS):
        arm = rotation @ leg
        velocity = x[VEHICLE_VELOCITY] + rotation @ np.cross(x[BODY_RATES], leg)
        depth = HEIGHT - x[2] - arm[2]
        stiffness, chi, damping = ground.contact(VEHICLE.ground, 9.81, 2.0, len(LEGS))  # type: ignore[arg-type]
        normal = stiffness * depth * (1.0 - chi * velocity[2])
        if depth <= 0.0 or normal <= 0.0:
            how.append("aloft")
            continue
        anchor = np.array([inner[ANCHOR_EAST + index], inner[ANCHOR_NORTH + index]])
        across = -stiffness * (x[0:2] + arm[:2] - anchor) - damping * velocity[:2]
        most = 0.6 * normal
        how.append("sticks" if np.linalg.norm(across) <= most else "slips")
        across *= min(1.0, most / np.linalg.norm(across))
        one = np.array([*across, normal])
        force += one
        moment += np.cross(arm, one)
    return np.concatenate([force, rotation.T @ moment]), how


def test_figures_of_a_contact() -> None:
    """Sinks in by `sink` under its share of the weight; small bounces have the damping ratio of both."""
    stiffness, chi, damping = ground.contact(Ground(sink=0.004, damping_ratio=0.7), 9.81, 6.0, 3)
    assert stiffness * 0.004 == pytest.approx(2.0 * 9.81)
    natural = math.sqrt(stiffness / 2.0)
    assert stiffness * chi * 0.004 == pytest.approx(2.0 * 0.7 * natural * 2.0)  # N per m/s, about rest
    assert damping == pytest.approx(2.0 * 0.7 * natural * 2.0)


def test_the_force_of_a_contact_that_sticks() -> None:
    force = ground.stuck_force(1000.0, 0.5, 30.0, 0.01, 0.002, -0.003, 0.1, 0.2, -0.4)
    assert force == pytest.approx((-2.0 - 3.0, 3.0 - 6.0, 10.0 * 1.2))


@pytest.mark.parametrize(
    ("depth", "given", "acts"),
    [
        (0.01, (3.0, 4.0, 10.0), (3.0, 4.0, 10.0)),
        (0.01, (30.0, 40.0, 10.0), (3.0, 4.0, 10.0)),  # slips: mu N
        (0.01, (3.0, 4.0, 0.0), (0.0, 0.0, 0.0)),
        (0.01, (3.0, 4.0, -1.0), (0.0, 0.0, 0.0)),  # never a pull
        (0.0, (3.0, 4.0, 10.0), (0.0, 0.0, 0.0)),
        (-0.5, (3.0, 4.0, 10.0), (0.0, 0.0, 0.0)),
        (0.01, (0.0, 0.5, 0.9), (0.0, 0.45, 0.9)),
    ],
)
def test_the_force_of_any_contact(depth: float, given: Any, acts: Any) -> None:
    assert ground.contact_force(0.5, depth, *given) == pytest.approx(acts)


def test_all_legs_that_stand_and_stick() -> None:
    x, inner = in_the_ground(depth=0.15)
    x[VEHICLE_VELOCITY], x[BODY_RATES] = (0.005, -0.004, -0.003), (0.01, -0.02, 0.03)
    expected, how = expected_wrench(x, inner)
    assert how == ["sticks"] * 5
    out = np.zeros(7)
    assert ground.ground_on_standing(P, x, inner, out) == 0
    np.testing.assert_allclose(out[:6], expected, rtol=1e-9)
    moving = np.zeros(7)
    ground.ground_on_moving(P, x, inner, moving)
    np.testing.assert_allclose(moving[:6], expected, rtol=1e-9)
    ground.ground_on_vehicle(P, x, inner, out)
    assert out[ground.LOOSE] == 0.0


def test_legs_that_are_aloft_stick_or_slip() -> None:
    x, inner = in_the_ground()
    inner[ANCHOR_EAST] += 0.02
    expected, how = expected_wrench(x, inner)
    assert set(how) == {"aloft", "sticks", "slips"}
    out = np.zeros(7)
    ground.ground_on_vehicle(P, x, inner, out)
    np.testing.assert_allclose(out[:6], expected, rtol=1e-9)
    assert out[ground.LOOSE] == 1.0
    assert ground.ground_on_standing(P, x, inner, out) == how.count("aloft") + how.count("slips")


def test_one_leg_that_slips_or_rises_fast_is_loose() -> None:
    x, inner = in_the_ground(depth=0.15)
    x[VEHICLE_VELOCITY], x[BODY_RATES] = (0.005, -0.004, -0.003), (0.01, -0.02, 0.03)
    inner[ANCHOR_NORTH + 3] += 1.0
    out = np.zeros(7)
    assert ground.ground_on_standing(P, x, inner, out) == 1
    ground.ground_on_vehicle(P, x, inner, out)
    np.testing.assert_allclose(out, [*expected_wrench(x, inner)[0], 1.0], rtol=1e-9)
    x, inner = in_the_ground(depth=0.15)
    x[5] = 1e3  # every normal force would be a pull
    assert ground.ground_on_standing(P, x, inner, np.zeros(7)) == 5
    out = np.full(7, 9.0)
    ground.ground_on_vehicle(P, x, inner, out)
    assert out.tolist() == [0.0] * 6 + [1.0]


def load_at(x: Array, inner: Array, depth: float) -> None:
    x[13:16] = 5.0, 6.0, HEIGHT + 0.05 - depth
    x[16:19] = 0.02, -0.01, -0.03
    inner[ANCHOR_EAST + LOAD_CONTACT], inner[ANCHOR_NORTH + LOAD_CONTACT] = 5.001, 5.998


def test_force_on_the_load() -> None:
    x, inner = in_the_ground()
    load_at(x, inner, 0.01)
    stiffness, chi, damping = ground.contact(VEHICLE.ground, 9.81, 0.7, 1)  # type: ignore[arg-type]
    normal = stiffness * 0.01 * (1.0 + chi * 0.03)
    east, north = stiffness * 0.001 - damping * 0.02, -stiffness * 0.002 + damping * 0.01
    assert math.hypot(east, north) < P.load_friction * normal
    assert ground.ground_on_load(P, x, inner) == pytest.approx((east, north, normal), rel=1e-9)
    inner[ANCHOR_EAST + LOAD_CONTACT] += 1.0
    assert math.hypot(*ground.ground_on_load(P, x, inner)[:2]) == pytest.approx(P.load_friction * normal)
    load_at(x, inner, -0.001)
    assert ground.ground_on_load(P, x, inner) == (0.0, 0.0, 0.0)


# Anchors


def slipped(depth: float, rise: float, px: float, py: float) -> tuple[float, float]:
    """The anchor of contact 2 after a step; it was at (1, 2). chi = 0.5 s/m, mu = 0.5."""
    inner = np.zeros(INNER_SIZE)
    inner[ANCHOR_EAST + 2], inner[ANCHOR_NORTH + 2] = 1.0, 2.0
    ground.slip(1000.0, 0.5, 0.5, depth, rise, px, py, inner, 2)
    others = np.delete(inner, [ANCHOR_EAST + 2, ANCHOR_NORTH + 2])
    assert (others == 0.0).all()
    return inner[ANCHOR_EAST + 2], inner[ANCHOR_NORTH + 2]


def test_aloft_the_anchor_is_under_the_point() -> None:
    assert slipped(-0.1, 0.0, 7.0, 8.0) == (7.0, 8.0)
    assert slipped(0.0, 0.0, 7.0, 8.0) == (7.0, 8.0)
    assert slipped(0.1, 2.0, 7.0, 8.0) == (7.0, 8.0)  # rises so fast that the ground does not push
    assert slipped(0.1, 2.01, 7.0, 8.0) == (7.0, 8.0)
    assert slipped(-0.1, 3.0, 7.0, 8.0) == (7.0, 8.0)
    assert slipped(0.1, 1.99, 7.0, 8.0) != (7.0, 8.0)


def test_a_spring_within_the_cone_of_friction_holds_the_anchor() -> None:
    assert slipped(0.02, 0.0, 1.005, 2.008) == (1.0, 2.0)


def test_a_spring_beyond_the_cone_of_friction_drags_it_to_the_cone() -> None:
    """mu N / k = 0.5 · 0.02 m (1 - 0.5 s/m · 0.4 m/s) = 8 mm."""
    anchor = slipped(0.02, 0.4, 1.03, 2.04)
    assert anchor == pytest.approx((1.03 - 0.008 * 0.6, 2.04 - 0.008 * 0.8))


@pytest.mark.parametrize("loose", [False, True])
@pytest.mark.parametrize("above", [0.1, 0.5, 0.7, 1.1])
def test_anchors_move_when_a_leg_is_loose_or_about_to_touch(loose: bool, above: float) -> None:
    """m above the ground; no leg reaches further than 0.488 m."""
    assert P.leg_reach == pytest.approx(max(math.hypot(*leg) for leg in LEGS))
    x, inner = in_the_ground()
    x[2] = HEIGHT + above
    load_at(x, inner, 0.01)
    inner[ANCHOR_EAST : ANCHOR_EAST + 5] = 50.0  # far off: they have to follow
    before = inner.copy()
    ground.move_anchors(P, x, inner, loose)
    legs = [*range(ANCHOR_EAST, ANCHOR_EAST + 5), *range(ANCHOR_NORTH, ANCHOR_NORTH + 5)]
    moves = loose or P.leg_reach <= above < 2.0 * P.leg_reach
    assert (inner[legs] == before[legs]).all() == (not moves)


def test_a_leg_that_slips_takes_its_anchor_along_and_others_stay() -> None:
    x, inner = in_the_ground()
    load_at(x, inner, 0.01)
    inner[ANCHOR_EAST] += 0.2
    before = inner.copy()
    _, how = expected_wrench(x, inner)
    rotation = turned(x)
    ground.move_anchors(P, x, inner, True)
    for index, leg in enumerate(LEGS):
        arm = rotation @ leg
        rise = (x[VEHICLE_VELOCITY] + rotation @ np.cross(x[BODY_RATES], leg))[2]
        depth, chi = HEIGHT - x[2] - arm[2], P.contact_chi
        anchor = np.array([inner[ANCHOR_EAST + index], inner[ANCHOR_NORTH + index]])
        was = np.array([before[ANCHOR_EAST + index], before[ANCHOR_NORTH + index]])
        away = x[0:2] + arm[:2] - was
        most = 0.6 * depth * (1.0 - chi * rise)
        if how[index] == "aloft":
            np.testing.assert_allclose(anchor, x[0:2] + arm[:2], atol=1e-12)
        elif np.linalg.norm(away) > most:
            np.testing.assert_allclose(anchor, was + away * (1.0 - most / np.linalg.norm(away)), atol=1e-12)
        else:
            np.testing.assert_array_equal(anchor, was)
    assert how[0] == "slips"


def test_the_loads_anchor_follows_it() -> None:
    x, inner = in_the_ground()
    load_at(x, inner, 0.01)
    inner[ANCHOR_EAST + LOAD_CONTACT], inner[ANCHOR_NORTH + LOAD_CONTACT] = 5.0, 5.0
    ground.move_anchors(P, x, inner, False)
    most = P.load_friction * 0.01 * (1.0 + P.contact_chi * 0.03)
    where = (inner[ANCHOR_EAST + LOAD_CONTACT], inner[ANCHOR_NORTH + LOAD_CONTACT])
    assert where == pytest.approx((5.0, 6.0 - most))
    load_at(x, inner, -0.01)
    ground.move_anchors(P, x, inner, False)
    assert (inner[ANCHOR_EAST + LOAD_CONTACT], inner[ANCHOR_NORTH + LOAD_CONTACT]) == (5.0, 6.0)


def test_reach_of_no_legs() -> None:
    assert ground.leg_reach(()) == 0.0


def test_a_record_without_legs_has_no_ground_under_it() -> None:
    p = SimpleNamespace(**{**vars(P), "leg_count": 0, "leg_blocks": 0})
    x, inner = in_the_ground()
    out = np.full(7, 9.0)
    ground.ground_on_vehicle(p, x, inner, out)
    assert out[:6].tolist() == [0.0] * 6
