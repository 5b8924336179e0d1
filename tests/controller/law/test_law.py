"""The law, step by step and in flight."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from controller.design.catalogue import LARGEST_LEAN, design
from controller.design.motion.ramp import planned
from controller.design.names import DESIGNS
from controller.law.control_law import WORK, Design, engaged_memory, remember
from controller.law.control_step import law_step
from controller.law.reference import Path, circle, setpoint
from controller.law.state import EULER_ANGLES, LOAD_POSITION, STATE_SIZE, VEHICLE_POSITION, WRENCH_SIZE, Array
from sitl.studies.random_vehicles import random_vehicle
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.closed_loop import Flight, fly
from tests.controller.fleet import FLEET, attributes, delayed

ORIGIN = (0.0, 0.0, 0.0)
TARGET = (3.0, 5.0, 2.0)
LONG = FLEET["paper, 10 m"]
STEP = setpoint(TARGET, ORIGIN)
LONG_STEPS = (
    (1000197, (43.9, 49.8, 5.3)),
    (1000005, (39.3, -10.9, 2.0)),
    (1000042, (-9.5, 19.8, -1.8)),
    (1000198, (57.7, 27.8, 13.2)),
    (1000141, (-49.0, -34.8, 19.7)),
)
"""Random vehicles, by the seed that they are drawn from, and steps, m, that turned them over once."""


class Stepped:
    """The law as plain Python, one step after another; `limit` (N) is the most that its thrust may be."""

    def __init__(self, record: Design, path: Path, load: Array, limit: float = math.inf) -> None:
        self.law, self.path = attributes(record), attributes(path)
        self.memory, self.work = attributes(engaged_memory(load)), attributes(np.zeros(1, dtype=WORK))
        self.limit = limit

    def __call__(self, estimate: Array) -> Array:
        law_step(self.law, self.memory, self.path, estimate, self.work)
        self.work.achieved[:] = self.work.wrench
        self.work.achieved[0] = min(self.work.wrench[0], self.limit)
        remember(self.law, self.memory, self.work)
        return np.array(self.work.wrench)


def hover_at(vehicle: Vehicle, load: tuple[float, float, float]) -> Array:
    estimate = np.zeros(STATE_SIZE)
    estimate[LOAD_POSITION] = load
    estimate[VEHICLE_POSITION] = np.add(load, (0.0, 0.0, vehicle.hover_length))
    return estimate


@pytest.mark.parametrize("name", ["default", "paper"])
@pytest.mark.parametrize("vehicle", ["paper, 10 m", "small, lag"])
def test_engaging_makes_no_bump(name: str, vehicle: str) -> None:
    """Wherever it hovers when the law takes over, and wherever it is sent: at first it hovers on."""
    load = (7.0, -3.0, 12.0)
    described = delayed(FLEET[vehicle], 2)
    estimate = hover_at(described, load)
    law = Stepped(design(name, described, 250.0), setpoint((9.0, 9.0, 9.0), load), np.array(load))
    hover = [described.hover_thrust, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(law(estimate), hover, atol=1e-4 * hover[0])
    np.testing.assert_array_equal(law.memory.integral, 0.0)


@pytest.mark.parametrize("name", DESIGNS)
def test_hover_is_an_equilibrium(name: str) -> None:
    estimate = hover_at(LONG, TARGET)
    law = Stepped(design(name, LONG, 250.0), setpoint(TARGET, TARGET), np.array(TARGET))
    for _ in range(5):
        np.testing.assert_allclose(law(estimate), [LONG.hover_thrust, 0, 0, 0], atol=1e-9)


def test_integral_is_trapezoidal() -> None:
    law = Stepped(design("paper", LONG, 50.0), setpoint(ORIGIN, ORIGIN), np.zeros(3))
    times = np.arange(40) / 50.0
    errors = np.column_stack([np.sin(3 * times), times**2, 1.0 - times])
    for error in errors:
        estimate = hover_at(LONG, ORIGIN)
        estimate[LOAD_POSITION] = error
        law(estimate)
    np.testing.assert_allclose(law.memory.integral, np.trapezoid(errors, dx=1 / 50, axis=0), atol=1e-12)


def test_past_commands_newest_first_as_far_as_they_were_given() -> None:
    vehicle = delayed(LONG, 3)
    limit = vehicle.hover_thrust + 1.0
    law = Stepped(design("default", vehicle, 100.0), setpoint(ORIGIN, ORIGIN), np.zeros(3), limit)
    rng = np.random.default_rng(2)
    given = []
    for _ in range(6):
        estimate = hover_at(vehicle, ORIGIN)
        estimate += 0.05 * rng.standard_normal(STATE_SIZE)
        wrench = law(estimate)
        wrench[0] = min(wrench[0], limit)
        given.append(wrench - [vehicle.hover_thrust, 0, 0, 0])
    assert any(g[0] == pytest.approx(1.0) for g in given)  # the limit was met
    np.testing.assert_allclose(law.memory.past[:3], given[:-4:-1], atol=1e-9)


@pytest.mark.parametrize("told", [0, 1, 3])
def test_it_knows_what_lagging_rotors_give(told: int) -> None:
    """Against the exact answer of a first-order lag to commands that act `told` ticks late."""
    vehicle = delayed(FLEET["small, lag"], told)
    law = Stepped(design("default", vehicle, 100.0), setpoint(ORIGIN, ORIGIN), np.zeros(3))
    rng = np.random.default_rng(4)
    commands, rotors = [np.zeros(WRENCH_SIZE)] * told, np.zeros(WRENCH_SIZE)
    for _ in range(20):
        np.testing.assert_allclose(law.memory.rotors, rotors, atol=1e-12)
        estimate = hover_at(vehicle, ORIGIN) + 0.01 * rng.standard_normal(STATE_SIZE)
        commands.append(law(estimate) - [vehicle.hover_thrust, 0, 0, 0])
        rotors = rotors + (commands.pop(0) - rotors) * -np.expm1(-0.01 / 0.02)


def test_a_full_turn_of_yaw_is_none() -> None:
    record = design("default", LONG, 250.0)
    wrenches = []
    for turns in (-2, 0, 1):
        estimate = hover_at(LONG, ORIGIN)
        estimate[-1] = 0.3 + 2 * math.pi * turns
        wrenches.append(Stepped(record, setpoint(ORIGIN, ORIGIN), np.zeros(3))(estimate))
    np.testing.assert_allclose(wrenches[0], wrenches[1], atol=1e-9)
    np.testing.assert_allclose(wrenches[2], wrenches[1], atol=1e-9)
    assert wrenches[1][3] < 0.0  # and it turns back the short way


@given(roll=st.floats(-1.3, 1.3), pitch=st.floats(-1.3, 1.3), time=st.floats(0.0, 6.0))
def test_lean_is_the_angle_between_thrusts(roll: float, pitch: float, time: float) -> None:
    """Away from hover, too: the default design measures it from the thrust that its motion asks for."""
    path = planned(circle((0.0, 0.0, 0.0), 5.0, 1.5, ORIGIN), FLEET["paper"])
    law = Stepped(design("default", FLEET["paper"], 250.0), path, np.zeros(3))
    law.memory.ticks = round(250.0 * time)
    estimate = hover_at(FLEET["paper"], ORIGIN)
    estimate[EULER_ANGLES] = roll, pitch, 0.0
    law(estimate)
    asked = thrust_direction(*law.work.desired[EULER_ANGLES])
    angle = math.acos(np.clip(asked @ thrust_direction(roll, pitch, 0.0), -1.0, 1.0))
    assert np.linalg.norm(law.work.deviation[15:17]) == pytest.approx(angle, abs=1e-6)


def thrust_direction(roll: float, pitch: float, yaw: float) -> Array:
    """The body's z axis in the world, R = Rz·Ry·Rx."""
    return np.asarray(Rotation.from_euler("ZYX", (yaw, pitch, roll)).as_matrix()[:, 2])


def test_deviations_are_seen_along_the_cable() -> None:
    """A load that lags by a centimetre along a cable aslant is answered by thrust, not by leaning."""
    path = circle((0.0, 0.0, 0.0), 5.0, 1.5, ORIGIN)
    law = Stepped(design("default", FLEET["paper"], 250.0), path, np.zeros(3))
    law.memory.ticks = 2000
    law(hover_at(FLEET["paper"], ORIGIN))
    desired = law.work.desired.copy()
    cable = desired[VEHICLE_POSITION] - desired[LOAD_POSITION]
    estimate = desired.copy()
    estimate[LOAD_POSITION] -= 0.01 * cable / np.linalg.norm(cable)
    law.memory.ticks = 2000
    law(estimate)
    assert math.atan2(math.hypot(*cable[:2]), cable[2]) > math.radians(45.0)
    np.testing.assert_allclose(law.work.deviation[LOAD_POSITION], (0.0, 0.0, -0.01), atol=1e-6)


@pytest.mark.parametrize("away", [20.0, 500.0])
def test_no_error_asks_for_more_than_the_largest_lean(away: float) -> None:
    """A vehicle that leans so far already gets no moment, however far it is off."""
    vehicle = load_vehicle("heavy")
    estimate = hover_at(vehicle, (-away, 0.0, 0.0))
    moments = []
    for lean in (LARGEST_LEAN, 0.0):
        estimate[EULER_ANGLES] = (0.0, lean, 0.0)
        moments.append(
            Stepped(design("default", vehicle, 250.0), setpoint(ORIGIN, ORIGIN), np.zeros(3))(estimate)[2]
        )
    assert abs(moments[0]) < 1e-6 * moments[1]


@pytest.mark.parametrize(("number", "step"), LONG_STEPS)
def test_long_leans_are_flown_like_short_ones(number: int, step: tuple[float, float, float]) -> None:
    """On a long cable that is held aslant for seconds; gains in the world's axes lose some of these."""
    vehicle = random_vehicle(np.random.default_rng(number), 50.0)
    path = planned(setpoint(step, ORIGIN), vehicle)
    flight = fly(vehicle, design("default", vehicle, 250.0), path, float(path["ramp_time"][0]) + 6.0, 250.0)
    assert flight.metrics["settled"]
    assert flight.metrics["settling_time_1cm_s"] is not None


def flown(name: str, vehicle: Vehicle, path: Path = STEP, rate_hz: float = 250.0, delay: int = 0) -> Flight:
    return fly(vehicle, design(name, vehicle, rate_hz), path, 30.0, rate_hz, delay)


def test_the_papers_design_flies_as_the_paper_says() -> None:
    """V.B: 2 % at about 6.3 s, 25 % overshoot in z, and the rotors stay clear of their limits."""
    flight = flown("paper", LONG)
    assert flight.metrics["settled"]
    assert flight.metrics["settling_time_2pct_s"] == pytest.approx(6.3, abs=0.1)
    assert flight.metrics["overshoot_pct"] == pytest.approx(25.0, abs=1.0)
    assert flight.metrics["steady_state_error_m"] < 1e-3  # type: ignore[operator]
    assert not flight.limited.any()


def test_the_default_design_flies_v_b_and_bears_delay() -> None:
    undelayed = flown("default", LONG).metrics
    assert undelayed["settling_time_2pct_s"] <= 6.0  # type: ignore[operator]
    for ticks in (1, 2, 4):  # that the controller is not told of
        metrics = flown("default", LONG, delay=ticks).metrics
        assert metrics["settled"]
        assert metrics["steady_state_error_m"] <= 1e-3  # type: ignore[operator]
        assert metrics["settling_time_2pct_s"] == pytest.approx(undelayed["settling_time_2pct_s"], rel=0.1)


@pytest.mark.parametrize("told", [0, 1, 2])
def test_the_default_design_flies_v_b_at_50_hz(told: int) -> None:
    metrics = flown("default", delayed(LONG, told), rate_hz=50.0, delay=told).metrics
    assert metrics["settled"]
    assert metrics["settling_time_2pct_s"] <= 6.0  # type: ignore[operator]
    assert metrics["steady_state_error_m"] <= 1e-3  # type: ignore[operator]


@pytest.mark.parametrize("vehicle", FLEET.values(), ids=FLEET)
def test_the_default_design_flies_every_vehicle(vehicle: Vehicle) -> None:
    """A step of 3 m, hardly at the rotors' limits."""
    flight = flown("default", vehicle, setpoint((3.0, 0.0, 0.0), ORIGIN))
    assert flight.metrics["settled"]
    assert flight.metrics["settling_time_2pct_s"] < 6.0  # type: ignore[operator]
    assert flight.limited.sum() / 250.0 <= 0.5  # s


@pytest.mark.parametrize("vehicle", ["paper", "paper, 10 m"])
def test_the_default_design_follows_the_circle(vehicle: str) -> None:
    flight = flown("default", FLEET[vehicle], circle((0.0, 0.0, 5.0), 5.0, 1.0, ORIGIN))
    assert flight.metrics["tracking_rms_m"] < 0.05  # type: ignore[operator]
    assert not flight.limited.any()


WEAK = load_vehicle("paper", ["cable.rest_length=10", *(f"rotors.{i}.max_speed=23.5" for i in range(4))])
"""Hardly more thrust than it takes to hover: 12.6 %."""
FAR = setpoint((0.0, 0.0, 15.0), ORIGIN)


def test_no_wind_up_against_a_limit() -> None:
    """The paper's design, sent 15 m up at once: it hangs at its limit, and arrives as if it had none."""
    guarded = design("paper", WEAK, 250.0)
    unguarded = guarded.copy()
    unguarded["anti_windup"] = 0.0
    flight, lost = (fly(WEAK, record, FAR, 30.0, 250.0) for record in (guarded, unguarded))
    assert flight.limited.sum() / 250.0 > 1.0  # s: it did meet the limit
    assert flight.metrics["settled"]
    assert flight.metrics["settling_time_2pct_s"] < 10.0  # type: ignore[operator]
    assert flight.metrics["overshoot_pct"] < 25.0  # type: ignore[operator]
    assert np.abs(flight.integral).max() < 40.0  # m s
    assert not lost.metrics["settled"]
    assert np.abs(lost.integral).max() > 10 * np.abs(flight.integral).max()
