"""The law's step as plain Python against its formulas on whole vectors, with random gains."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controller.design.motion.ramp import planned
from controller.law import control_law, control_step, rotations
from controller.law.allocation import allocation
from controller.law.control_law import DESIGN, FEEDFORWARD, INTEGRATOR, STATE, WORK, engaged_memory
from controller.law.flatness import STENCIL, body, flat_motion
from controller.law.reference import Path, circle, setpoint
from controller.law.state import (
    LOAD_POSITION,
    LOAD_VELOCITY,
    STATE_SIZE,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
    WRENCH_SIZE,
    Array,
)
from tests.controller.fleet import FLEET, attributes

PERIOD, DELAY, YAW = 0.02, 3, 0.8
ORIGIN = (0.0, 0.0, 0.0)
ANCHOR, TARGET = np.array([1.0, -2.0, 0.5]), (4.0, 3.0, 2.0)
VEHICLE = FLEET["paper"]
WORLD_VECTORS = (VEHICLE_POSITION, LOAD_POSITION, VEHICLE_VELOCITY, LOAD_VELOCITY)


class Law:
    """Design, memory and scratch with random numbers in all that a design may choose."""

    def __init__(self, entry: int, path: Path, delay: int = DELAY, controlled: int = 3) -> None:
        rng = np.random.default_rng(7)
        record = np.zeros(1, dtype=DESIGN)
        for name in ("state_gain", "lag_gain", "integral_gain", "past_gain", "anti_windup"):
            record[name] = rng.normal(size=record[name].shape)
        record["entry"], record["controlled"], record["period"], record["delay"] = (
            entry,
            controlled,
            PERIOD,
            delay,
        )
        record["lag_decay"], record["lead_time"], record["rotor_lag"] = 0.4, 0.03, 0.02
        record["hover_state"][0, :3] = 0.0, 0.0, VEHICLE.hover_length
        record["hover_wrench"] = VEHICLE.hover_thrust, 0.0, 0.0, 0.0
        record["body"] = body(VEHICLE)
        path["yaw"] = YAW
        self.design, self.path = attributes(record), attributes(path)
        self.memory, self.work = attributes(engaged_memory(ANCHOR)), attributes(np.zeros(1, dtype=WORK))
        self.memory.past[:] = rng.normal(size=self.memory.past.shape)
        self.memory.rotors[:] = rng.normal(size=WRENCH_SIZE)

    def step(self, estimate: Array) -> Array:
        control_law.step(self.design, self.memory, self.path, estimate, self.work)
        return np.array(self.work.wrench)


def somewhere(seed: int = 2) -> Array:
    estimate = np.random.default_rng(seed).normal(size=STATE_SIZE)
    estimate[15:18] = 0.1, -0.2, 0.5
    return estimate


def heading_frame(yaw: float = YAW) -> Array:
    """World to heading, (3, 3)."""
    return np.asarray(Rotation.from_euler("Z", yaw).as_matrix().T)


def in_frame(vector: Array, frame: Array) -> Array:
    out = vector.copy()
    for part in WORLD_VECTORS:
        out[part] = frame @ vector[part]
    return out


def expected_wrench(law: Law, deviation: Array, integral: Array, feedforward: Array) -> Array:
    d, m = law.design, law.memory
    wrench = feedforward - d.state_gain @ deviation - d.integral_gain @ integral - d.lag_gain @ m.rotors
    for age in range(int(d.delay)):
        wrench = wrench - d.past_gain[age] @ m.past[age]
    return np.asarray(wrench)


@pytest.mark.parametrize(("entry", "origin"), [(INTEGRATOR, ANCHOR), (STATE, np.array(TARGET))])
def test_hover_is_where_the_entry_says(entry: int, origin: Array) -> None:
    law, estimate = Law(entry, setpoint(TARGET, ORIGIN)), somewhere()
    law.memory.integral[:] = 0.3, -0.2, 0.1
    desired = np.zeros(STATE_SIZE)
    desired[VEHICLE_POSITION] = np.add(origin, (0.0, 0.0, VEHICLE.hover_length))
    desired[LOAD_POSITION] = origin
    desired[17] = YAW
    deviation = in_frame(estimate - desired, heading_frame())
    hover = np.array([VEHICLE.hover_thrust, 0.0, 0.0, 0.0])
    expected = expected_wrench(law, deviation, heading_frame() @ [0.3, -0.2, 0.1], hover)
    np.testing.assert_allclose(law.step(estimate), expected, rtol=1e-10)
    np.testing.assert_allclose(law.work.desired, desired)
    np.testing.assert_allclose(law.work.deviation, deviation, atol=1e-12)
    np.testing.assert_allclose(law.work.reference, TARGET)


@pytest.mark.parametrize("controlled", [0, 3])
def test_the_error_of_the_controlled_position_is_integrated_by_trapezia(controlled: int) -> None:
    """In the world's axes, from the second step on."""
    law = Law(STATE, setpoint(TARGET, ORIGIN), controlled=controlled)
    errors = []
    for seed in range(4):
        estimate = somewhere(seed)
        errors.append(estimate[controlled : controlled + 3] - TARGET)
        law.step(estimate)
        np.testing.assert_allclose(law.memory.last_error, errors[-1])
        integral = np.trapezoid(errors, dx=PERIOD, axis=0)
        np.testing.assert_allclose(law.memory.integral, integral, atol=1e-12)
        np.testing.assert_allclose(law.work.integral, heading_frame() @ integral, atol=1e-12)
    assert law.memory.ticks == 4


@pytest.mark.parametrize(
    ("yaw", "expected"),
    [
        (0.0, -YAW),
        (YAW + 3.1, 3.1),
        (YAW + 3.2, 3.2 - 2 * math.pi),
        (YAW - 3.2, 2 * math.pi - 3.2),
        (13.0, None),
    ],
)
def test_the_yaws_deviation_is_the_short_way_round(yaw: float, expected: float | None) -> None:
    law, estimate = Law(STATE, setpoint(TARGET, ORIGIN)), somewhere()
    estimate[17] = yaw
    law.step(estimate)
    short = math.remainder(yaw - YAW, 2 * math.pi) if expected is None else expected
    assert law.work.deviation[17] == pytest.approx(short)


def one_piece() -> Path:
    """A step along one polynomial of degree 7, whose first three derivatives vanish at both ends."""
    path = setpoint(TARGET, ORIGIN)
    path["pieces"] = 1
    path["profile"][0, 0] = 0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0
    return path


FEASIBLE: dict[str, Path] = {
    "smooth step": setpoint(TARGET, ORIGIN),
    "planned step": planned(setpoint(TARGET, ORIGIN), VEHICLE),
    "step of one piece": one_piece(),
    "circle": circle(ORIGIN, 5.0, 1.5, ORIGIN),
    "planned circle": planned(circle(ORIGIN, 5.0, 1.5, ORIGIN), VEHICLE),
}


@pytest.mark.parametrize(("name", "loaded"), [*((name, True) for name in FEASIBLE), ("smooth step", False)])
def test_a_feasible_motion_is_followed_in_the_frame_of_its_cable(name: str, loaded: bool) -> None:
    """A planned one and a circle; that of a smooth step is the vertical's."""
    law, estimate = Law(FEEDFORWARD, FEASIBLE[name].copy()), somewhere()
    if not loaded:
        law.design.body = body(VEHICLE, loaded=False)
    law.memory.ticks, time = 60, 60 * PERIOD
    law.memory.integral[:] = 0.3, -0.2, 0.1
    law.memory.last_error[:] = 0.01, 0.02, 0.03
    desired, feedforward = np.zeros(STATE_SIZE), np.zeros(WRENCH_SIZE)
    stencil = attributes(np.zeros(1, dtype=STENCIL))
    heading = np.array([math.cos(YAW), math.sin(YAW)])
    design = law.design
    flat_motion(
        design.body,
        law.path,
        time,
        design.lead_time,
        design.rotor_lag,
        heading,
        stencil,
        desired,
        feedforward,
    )
    deviation = estimate - desired
    deviation[17] = math.remainder(deviation[17], 2 * math.pi)
    frame = heading_frame()
    if name != "smooth step":
        frame = cable_frame(stencil.pull[2] if loaded else stencil.force[2])
        deviation[15:17] = thrust_angle(desired, estimate)
    error = estimate[3:6] - desired[3:6]
    integral = np.array([0.3, -0.2, 0.1]) + 0.5 * PERIOD * (error + np.array([0.01, 0.02, 0.03]))
    expected = expected_wrench(law, in_frame(deviation, frame), frame @ integral, feedforward)
    np.testing.assert_allclose(law.step(estimate), expected, rtol=1e-9)
    np.testing.assert_allclose(law.work.frame, frame, atol=1e-12)
    np.testing.assert_allclose(law.work.reference, desired[3:6])


def cable_frame(upward: Array) -> Array:
    """Rows: z along `upward`, x in the plane of the heading and the vertical, y the third."""
    z = upward / np.linalg.norm(upward)
    across = np.array([-math.sin(YAW), math.cos(YAW), 0.0])
    x = np.cross(across, z)
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(z, x), z])


def thrust_angle(desired: Array, estimate: Array) -> Array:
    """Rotation (rad) about the body's x and y that takes the wanted thrust's direction to the real one."""

    def up(angles: Array) -> Array:
        return np.asarray(Rotation.from_euler("YX", (angles[1], angles[0])).as_matrix()[:, 2])

    body = np.asarray(Rotation.from_euler("YX", (desired[16], desired[15])).as_matrix())
    seen = body.T @ up(estimate[15:17])
    angle = math.acos(min(1.0, seen[2]))
    sine = math.hypot(seen[0], seen[1])
    return angle / sine * np.array([-seen[1], seen[0]])


def test_thrust_errors_small_and_large() -> None:
    out, zero = np.zeros(STATE_SIZE), np.zeros(STATE_SIZE)
    estimate = np.zeros(STATE_SIZE)
    estimate[15:17] = 1e-12, -2e-12
    control_law._thrust_error(zero, estimate, out)
    np.testing.assert_allclose(out[15:17], (1e-12, -2e-12), rtol=1e-6)
    for roll, pitch in ((0.5, 0.0), (0.0, -0.7), (2.5, 0.0), (0.4, 2.0)):
        estimate[15:17] = roll, pitch
        desired = np.zeros(STATE_SIZE)
        desired[15:17] = 0.3, 0.2
        control_law._thrust_error(desired, estimate, out)
        np.testing.assert_allclose(
            np.linalg.norm(out[15:17]), np.linalg.norm(thrust_angle(desired, estimate))
        )


def test_vectors_into_a_frame_and_out_of_it() -> None:
    frame = np.asarray(Rotation.from_euler("ZYX", (0.3, -0.5, 0.9)).as_matrix())
    vector = np.array([1.0, -2.0, 3.0])
    rotations.into(frame, vector)
    np.testing.assert_allclose(vector, frame @ [1.0, -2.0, 3.0])
    rotations.out_of(frame, vector)
    np.testing.assert_allclose(vector, [1.0, -2.0, 3.0])


# What is remembered


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_what_the_rotors_give_is_remembered(delay: int) -> None:
    law = Law(INTEGRATOR, setpoint(TARGET, ORIGIN), delay=delay)
    past, rotors = law.memory.past.copy(), law.memory.rotors.copy()
    law.step(somewhere())
    law.work.achieved[:] = np.add(law.work.wrench, (1.0, -0.5, 0.25, 2.0))
    given = np.subtract(law.work.achieved, (VEHICLE.hover_thrust, 0.0, 0.0, 0.0))
    integral = law.work.integral + law.design.anti_windup @ (law.work.achieved - law.work.wrench)
    control_law.remember(law.design, law.memory, law.work)
    acting = past[delay - 1] if delay > 0 else given
    np.testing.assert_allclose(law.memory.rotors, 0.4 * rotors + 0.6 * acting)
    np.testing.assert_allclose(law.memory.past[0], given)
    np.testing.assert_allclose(law.memory.past[1:], past[:-1])  # all of it: the delay may prove longer
    np.testing.assert_allclose(law.memory.integral, heading_frame().T @ integral, atol=1e-12)


def test_a_law_that_takes_over_remembers_where_the_load_was() -> None:
    memory = attributes(engaged_memory(ANCHOR))
    assert memory.anchor.tolist() == ANCHOR.tolist()
    assert memory.ticks == 0
    assert not memory.past.any()


# The whole control step


def test_what_is_declared_to_the_compiler_fits_a_law() -> None:
    law = (np.zeros(1, DESIGN), allocation(VEHICLE), setpoint(TARGET, ORIGIN), engaged_memory(ANCHOR))
    arrays = (*law, np.zeros(1, WORK), np.zeros(STATE_SIZE), np.zeros(16))
    entry = control_step.control_step
    assert entry.buffers == len(entry.arguments) == len(arrays)
    for declared, array in zip(entry.arguments, arrays, strict=True):
        assert (np.dtype(declared.dtype), declared.shape) == (array.dtype, array.shape)


def stepped(law: Law, estimate: Array) -> tuple[int, Array]:
    controls = np.full(16, 0.5)
    records: Any = [[record] for record in (law.design, attributes(allocation(VEHICLE)), law.path)]
    code = control_step.control_step.python(*records, [law.memory], [law.work], estimate, controls)
    return code, controls


def quiet(law: Law) -> Array:
    """No memory, and an estimate where the law asks for hover."""
    for name in ("state_gain", "lag_gain", "integral_gain", "past_gain"):
        law.design[name][:] = 0.0
    return np.zeros(STATE_SIZE)


def test_within_the_limits_the_step_returns_0_and_remembers_what_it_gave() -> None:
    law = Law(STATE, setpoint(TARGET, ORIGIN))
    code, controls = stepped(law, quiet(law))
    assert code == 0
    hover = (
        math.sqrt(VEHICLE.hover_thrust / 4 / VEHICLE.rotors[0].thrust_coefficient)
        / VEHICLE.rotors[0].max_speed
    )
    assert controls[:4] == pytest.approx([hover] * 4)
    np.testing.assert_allclose(law.memory.past[0], 0.0, atol=1e-9)


def test_at_a_limit_it_returns_1() -> None:
    law = Law(STATE, setpoint(TARGET, ORIGIN))
    estimate = quiet(law)
    law.design.state_gain[0, 2] = -1e6
    estimate[2] = 1e3
    code, controls = stepped(law, estimate)
    assert code == 1
    assert controls[:4] == pytest.approx([1.0] * 4)


@pytest.mark.parametrize("axis", range(4))
def test_a_wrench_that_is_no_number_stops_the_rotors_and_is_not_remembered(axis: int) -> None:
    law = Law(STATE, setpoint(TARGET, ORIGIN))
    estimate = quiet(law)
    law.design.hover_wrench[axis] = math.nan
    past = law.memory.past.copy()
    code, controls = stepped(law, estimate)
    assert code == 1
    assert np.isnan(controls).all()
    np.testing.assert_array_equal(law.memory.past, past)
