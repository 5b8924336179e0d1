"""The design `geometric`: its formulas on whole vectors, its linearisation, and its flights."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import sitl
from controller.design.catalogue import LARGEST_LEAN, design
from controller.design.motion.ramp import planned
from controller.law.control_law import WORK, Design, engaged_memory
from controller.law.control_step import law_step
from controller.law.reference import Path, circle, setpoint
from controller.law.rotations import seen_from, swung, turn_between
from controller.law.state import (
    BODY_RATES,
    EULER_ANGLES,
    LOAD_POSITION,
    LOAD_VELOCITY,
    STATE_SIZE,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
    Array,
)
from controller.law.terms import DELAY, INTEGRAL
from sitl.flights.scenario import Scenario, Setpoint
from sitl.studies.paper.analysis.beyond import NOISE_TO_REACH
from sitl.studies.random_vehicles import random_vehicle
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle, vehicle_names
from tests.controller.closed_loop import fly
from tests.controller.fleet import FLEET, attributes, delayed

ORIGIN = (0.0, 0.0, 0.0)
TARGET = (3.0, 5.0, 2.0)
PAPER = FLEET["paper"]
RATE = 250.0
angle = st.floats(-3.0, 3.0)
lean = st.floats(-1.4, 1.4)


class Flown:
    """The law as plain Python at one moment of a path."""

    def __init__(self, record: Design, path: Path, seconds: float) -> None:
        self.law, self.path = attributes(record), attributes(path)
        self.memory, self.work = attributes(engaged_memory(np.zeros(3))), attributes(np.zeros(1, dtype=WORK))
        self.ticks = round(seconds * RATE)
        self.integral = np.zeros(3)

    def __call__(self, estimate: Array) -> Array:
        self.memory.ticks = self.ticks
        self.memory.integral[:] = self.integral
        self.memory.last_error[:] = 0.0
        law_step(self.law, self.memory, self.path, estimate, self.work)
        return np.array(self.work.wrench)


def matrix(angles: Array) -> Array:
    """R = Rz·Ry·Rx of roll, pitch and yaw."""
    return np.asarray(Rotation.from_euler("ZYX", angles[::-1]).as_matrix())


@given(wanted=st.tuples(angle, lean, angle), actual=st.tuples(angle, lean, angle))
def test_errors_on_so3(wanted: tuple[float, ...], actual: tuple[float, ...]) -> None:
    one, other, out = matrix(np.array(wanted)), matrix(np.array(actual)), np.zeros(3)
    turn = Rotation.from_matrix(one.T @ other).as_rotvec()
    size = float(np.linalg.norm(turn))
    turn_between(one, other, out)
    if 1e-9 < size < math.pi - 1e-3:
        np.testing.assert_allclose(out, 2.0 * math.sin(size / 2.0) * turn / size, atol=1e-6)
    seen_from(other, one, np.array([0.3, -0.2, 0.1]), out)
    np.testing.assert_allclose(out, other.T @ one @ [0.3, -0.2, 0.1], atol=1e-12)
    turned = np.zeros((3, 3))
    swung(one, other[:, 2], turned)
    np.testing.assert_allclose(turned.T @ turned, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(turned[:, 2], other[:, 2], atol=1e-9)
    axis = Rotation.from_matrix(turned @ one.T).as_rotvec()
    assert abs(axis @ one[:, 2]) < 1e-6  # no twist about the thrust


def test_the_step_is_its_formulas() -> None:
    """On a circle, well away from it; everything on whole vectors."""
    path = planned(circle(ORIGIN, 5.0, 1.0, ORIGIN), PAPER)
    path["yaw"] = 0.7
    flown = Flown(design("geometric", PAPER, RATE), path, 9.0)
    flown.integral = np.array([0.02, -0.03, 0.01])
    work = flown.work
    flown(np.zeros(STATE_SIZE) + 0.1)
    wanted = np.array(work.desired)
    rng = np.random.default_rng(5)
    estimate = wanted + 0.1 * rng.normal(size=STATE_SIZE)
    wrench = flown(estimate)

    def cable(x: Array) -> tuple[float, Array, float, Array]:
        """Length, direction n from load to vehicle, and their rates."""
        away, rate = (
            x[VEHICLE_POSITION] - x[LOAD_POSITION],
            x[VEHICLE_VELOCITY] - x[LOAD_VELOCITY],
        )
        length = float(np.linalg.norm(away))
        n = away / length
        return length, n, float(rate @ n), (rate - n * (rate @ n)) / length

    length, n, lengthening, n_rate = cable(estimate)
    length_ref, n_ref, lengthening_ref, n_rate_ref = cable(wanted)
    across = np.eye(3) - np.outer(n, n)
    e_p, e_v = (estimate[part] - wanted[part] for part in (LOAD_POSITION, LOAD_VELOCITY))
    e_n = -across @ n_ref
    turn = np.cross(np.cross(n_ref, n_rate_ref), n)
    e_rate = (length * n_rate - length_ref * turn) - lengthening_ref * (across @ n_ref)
    place = across @ e_p + length_ref * e_n + n * (e_p @ n + length - length_ref)
    speed = across @ e_v + e_rate + n * (e_v @ n + lengthening - lengthening_ref)
    heading = np.array([math.cos(0.7), math.sin(0.7), 0.0])
    x = heading - np.array([0.0, 0.0, heading @ n / n[2]])  # above or below the heading
    x /= np.linalg.norm(x)
    frame = np.array([x, np.cross(n, x), n])
    gains = work.gains  # this far from its reference they are not the stiff ones
    translation = np.concatenate([frame @ part for part in (place, e_p, speed, e_v)])
    integral = frame @ flown.memory.integral
    asked = -gains.state_gain[:, :12] @ translation - gains.integral_gain @ integral
    planned_attitude, attitude = matrix(wanted[EULER_ANGLES]), matrix(estimate[EULER_ANGLES])
    thrust = planned_attitude[:, 2]
    size = float(np.linalg.norm(work.stencil.force[2]))
    leaned = asked[2] / gains.state_gain[2, 16] * frame[0] - asked[1] / gains.state_gain[1, 15] * frame[1]
    force = size * (thrust + leaned) + asked[0] * n
    assert np.linalg.norm(np.cross(thrust, force)) < math.tan(LARGEST_LEAN) * (thrust @ force)
    commanded = np.zeros((3, 3))
    swung(planned_attitude, force / np.linalg.norm(force), commanded)
    e_r = np.zeros(3)
    turn_between(commanded, attitude, e_r)
    rates, rates_ref = estimate[BODY_RATES], wanted[BODY_RATES]
    e_w = rates - attitude.T @ commanded @ rates_ref
    inertia = np.array(PAPER.airframe.inertia)
    moments = work.feedforward[1:] - gains.state_gain[1:, 12:] @ np.concatenate([e_w, e_r])
    moments += np.cross(rates, inertia * rates) - np.cross(rates_ref, inertia * rates_ref)
    np.testing.assert_allclose(wrench[0], work.feedforward[0] + force @ attitude[:, 2] - size, rtol=1e-9)
    np.testing.assert_allclose(wrench[1:], moments, rtol=1e-9)
    np.testing.assert_allclose(np.array(work.terms)[:DELAY].sum(axis=0), wrench, rtol=1e-9)
    np.testing.assert_allclose(work.terms[INTEGRAL], -gains.integral_gain @ integral, rtol=1e-9)


@pytest.mark.parametrize("vehicle", ["paper", "paper, 10 m", "small, lag"])
def test_at_hover_it_is_the_linear_law_of_its_gains_to_first_order(vehicle: str) -> None:
    """So that what `margins` finds of the gains holds for it, too."""
    told = delayed(FLEET[vehicle], 1)
    record = design("geometric", told, RATE)
    linear = record.copy()
    linear["geometric"] = 0
    laws = [Flown(one, setpoint(TARGET, TARGET), 5.0) for one in (linear, record)]
    hover = np.zeros(STATE_SIZE)
    hover[LOAD_POSITION] = TARGET
    hover[VEHICLE_POSITION] = np.add(TARGET, (0.0, 0.0, told.hover_length))
    for index in range(STATE_SIZE):
        slopes = []
        for law in laws:
            ends = []
            for sign in (1.0, -1.0):
                estimate = hover.copy()
                estimate[index] += sign * 1e-4
                law.memory.last_error[:] = 0.0
                ends.append(law(estimate))
            slopes.append((ends[0] - ends[1]) / 2e-4)
        np.testing.assert_allclose(
            slopes[1], slopes[0], atol=1e-4 * float(np.abs(laws[0].law.state_gain).max())
        )


@pytest.mark.parametrize("away", [20.0, 500.0])
def test_no_error_asks_for_more_than_the_largest_lean(away: float) -> None:
    vehicle = load_vehicle("heavy")
    estimate = np.zeros(STATE_SIZE)
    estimate[VEHICLE_POSITION] = 0.0, 0.0, vehicle.hover_length
    estimate[[0, 3]] -= away
    moments = []
    for lean in (LARGEST_LEAN, 0.0):
        estimate[EULER_ANGLES] = (0.0, lean, 0.0)
        moments.append(Flown(design("geometric", vehicle, RATE), setpoint(ORIGIN, ORIGIN), 0.0)(estimate)[2])
    assert abs(moments[0]) < 1e-6 * moments[1]


def test_a_vehicle_on_its_back_stops_its_rotors_and_turns_over() -> None:
    estimate = np.zeros(STATE_SIZE)
    estimate[VEHICLE_POSITION] = 0.0, 0.0, PAPER.hover_length
    for roll in (2.9, -2.9):
        estimate[EULER_ANGLES] = roll, 0.0, 0.0
        wrench = Flown(design("geometric", PAPER, RATE), setpoint(ORIGIN, ORIGIN), 0.0)(estimate)
        assert wrench[0] < 0.0
        assert wrench[1] * roll < 0.0


@pytest.mark.parametrize("vehicle", FLEET.values(), ids=FLEET)
def test_it_flies_v_b_with_every_vehicle_and_bears_20_ms(vehicle: Vehicle) -> None:
    """Nominally, and with five ticks of delay that it is not told of."""
    path = planned(setpoint(TARGET, ORIGIN), vehicle)
    record = design("geometric", vehicle, RATE)
    nominal, late = (fly(vehicle, record, path, 14.0, RATE, ticks).metrics for ticks in (0, 5))
    assert nominal["settling_time_1cm_s"] < 4.5  # type: ignore[operator]
    assert nominal["overshoot_pct"] < 0.5  # type: ignore[operator]
    assert late["settled"]
    assert late["overshoot_pct"] < 5.0  # type: ignore[operator]


@pytest.mark.parametrize("length", ["1", "10"])
def test_both_laws_hold_the_load_against_noise(length: str) -> None:
    for chosen in ("default", "geometric"):
        flight = sitl.fly(
            "hover",
            design=chosen,
            overrides=[f"cable.rest_length={length}"],
            plant_overrides=["disturbance.force_std=5", "disturbance.acts_on=load"],
            duration_s=30.0,
            seed=1,
        )
        load = np.stack([flight.states[f"load_{axis}_m"] for axis in "xyz"], axis=1)
        distances = np.linalg.norm(load - flight.reference, axis=1)[flight.states["time_s"] >= 8.0]
        assert np.sqrt(np.mean(distances**2)) < NOISE_TO_REACH[length]


@pytest.mark.parametrize("length", [1.0, 10.0])
@pytest.mark.parametrize("swing", [20.0, 60.0])
def test_it_catches_a_load_that_swings(length: float, swing: float) -> None:
    """Which a stiffer law does not: the vehicle begins aside of the load, at rest, as if it hovered."""
    reach = length + 0.981
    aside, above = reach * math.sin(math.radians(swing)), reach * math.cos(math.radians(swing))
    vehicle = load_vehicle(
        "paper", [f"cable.rest_length={length}", f"initial.vehicle_position=[{aside}, 0, {above}]"]
    )
    flight = fly(vehicle, design("geometric", vehicle, RATE), setpoint(ORIGIN, ORIGIN), 20.0, RATE)
    last = flight.states[-1]
    assert np.linalg.norm(last[LOAD_POSITION]) < 0.01
    assert np.linalg.norm((last[VEHICLE_POSITION] - last[LOAD_POSITION])[:2]) < 0.01 * reach


@pytest.mark.parametrize("vehicle", ["paper", "paper, 10 m"])
def test_it_follows_the_circle(vehicle: str) -> None:
    path = planned(circle((0.0, 0.0, 5.0), 5.0, 1.0, ORIGIN), FLEET[vehicle])
    flight = fly(FLEET[vehicle], design("geometric", FLEET[vehicle], RATE), path, 24.0, RATE)
    assert flight.metrics["tracking_rms_m"] < 1e-3  # type: ignore[operator]


def three_metres(name: str) -> Scenario:
    """A step east from hover."""
    x, y, z = load_vehicle(name).initial.load_position
    reference = Setpoint(kind="setpoint", position=(x + 3.0, y, z))
    return Scenario(vehicle=name, set=("initial.start=hover",), reference=reference)


@pytest.mark.parametrize("name", vehicle_names())
def test_it_flies_every_shipped_vehicle(name: str) -> None:
    flight = sitl.fly(three_metres(name), design="geometric", feedback="truth", duration_s=10.0)
    assert flight.summary["settled"]
    assert flight.summary["settling_time_1cm_s"] < 6.0


@pytest.mark.parametrize("name", ["iris", "heavy"])
def test_on_estimates_it_flies_as_near_as_the_default_design(name: str) -> None:
    """The receiver's wander decides, whatever the law."""
    errors = []
    for chosen in ("default", "geometric"):
        flight = sitl.fly(three_metres(name), design=chosen, feedback="estimate", duration_s=12.0)
        load = np.stack([flight.states[f"load_{axis}_m"] for axis in "xyz"], axis=1)
        late = flight.states["time_s"] > 6.0
        errors.append(float(np.linalg.norm((load - flight.reference)[late], axis=1).max()))
    assert errors[1] < 1.05 * errors[0]


@pytest.mark.parametrize(("number", "step"), [(1000005, (39.3, -10.9, 2.0)), (1000141, (-49.0, -34.8, 19.7))])
def test_long_leans_are_flown(number: int, step: tuple[float, float, float]) -> None:
    vehicle = random_vehicle(np.random.default_rng(number), 50.0)
    path = planned(setpoint(step, ORIGIN), vehicle)
    flight = fly(vehicle, design("geometric", vehicle, RATE), path, float(path["ramp_time"][0]) + 6.0, RATE)
    assert flight.metrics["settled"]
    assert flight.metrics["settling_time_1cm_s"] is not None
