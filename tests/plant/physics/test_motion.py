"""The kernels of motion by themselves, as plain Python: rates, a step, a split step, tables, reactions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sitl_bridge.plant.physics import dynamics
from sitl_bridge.plant.physics.cables.cable import stretch, taut_force, tension_of
from sitl_bridge.plant.physics.cables.flexible_cable import flexible_cable
from sitl_bridge.plant.physics.ground import LOOSE, ground_on_load, ground_on_vehicle
from sitl_bridge.plant.physics.parameters import PARAMETERS, parameters
from sitl_bridge.plant.physics.rotors import rotor_wrench
from sitl_bridge.plant.physics.state import (
    ANCHOR_EAST,
    ANGULAR_ACCELERATION,
    ATTITUDE,
    BODY_RATES,
    CABLE_HOLDS,
    CABLE_STATE,
    INNER_SIZE,
    LOAD_CONTACT,
    LOAD_GROUND_FORCE,
    LOAD_POSITION,
    LOAD_VELOCITY,
    MOST_ROTORS,
    REACTIONS_SIZE,
    SPECIFIC_FORCE,
    STATE_SIZE,
    TENSION,
    VEHICLE_GROUND_FORCE,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
    Array,
    initial_inner_state,
    initial_state,
)
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.fleet import attributes
from tests.plant.flying import plain_vehicle

LEGS = [(0.3, 0.2, -0.25), (-0.3, 0.25, -0.25), (-0.3, -0.2, -0.25), (0.25, -0.3, -0.25)]
FORCE = np.array([1.0, -2.0, 0.5, 0.3, 0.2, -0.1])
WIND = np.array([3.0, 2.0, -1.0, 1.0, -2.0, 0.5])
WRENCH = (25.0, 0.1, -0.2, 0.3)


def windy(**changes: Any) -> Vehicle:
    """Everything acts: drag, ground, a cable that pulls."""
    content: dict[str, Any] = {
        "airframe": {"legs": LEGS, "drag": {"linear": 0.2, "quadratic": 0.1}},
        "load": {"radius": 0.05, "drag": {"linear": 0.05, "quadratic": 0.02}},
        "cable": {"damping": 4.0},
        "ground": {"sink": 0.004},
        "initial": {"vehicle_position": [0.0, 0.0, 8.0], "load_position": [0.0, 0.0, 6.9]},
    }
    return plain_vehicle(**{**content, **changes})


def record(vehicle: Vehicle) -> Any:
    return attributes(parameters(vehicle))


def moving(seed: int = 4, length: float = 1.3) -> tuple[Array, Array]:
    """State in the air, all of it moving, and inner state."""
    rng = np.random.default_rng(seed)
    x, inner = rng.normal(size=STATE_SIZE), np.zeros(INNER_SIZE)
    x[VEHICLE_POSITION] = 1.0, -2.0, 5.0
    x[ATTITUDE] /= np.linalg.norm(x[ATTITUDE])
    x[LOAD_POSITION] = x[VEHICLE_POSITION] + length * np.array([0.48, -0.36, -0.8])
    inner[:4] = 100.0, 110.0, 120.0, 130.0
    inner[CABLE_HOLDS] = 1.0
    return x, inner


def rotation(x: Array) -> Array:
    return np.asarray(Rotation.from_quat(x[ATTITUDE], scalar_first=True).as_matrix())


def drag(linear: float, quadratic: float, velocity: Array) -> Array:
    return -(linear + quadratic * np.linalg.norm(velocity)) * velocity


def expected_rates(p: Any, x: Array, inner: Array, wrench: Any, taut: bool, drags: bool = True) -> Array:
    """Newton and Euler, in vectors."""
    vehicle, load = FORCE[:3] + rotation(x)[:, 2] * wrench[0], FORCE[3:].copy()
    moment = np.array(wrench[1:])
    if taut:
        pull = np.array(taut_force(p, x))
        vehicle, load = vehicle + pull, load - pull
    if drags:
        vehicle = vehicle + drag(0.2, 0.1, x[VEHICLE_VELOCITY] - WIND[:3])
        load = load + drag(0.05, 0.02, x[LOAD_VELOCITY] - WIND[3:])
    if p.has_ground:
        ground = np.zeros(7)
        ground_on_vehicle(p, x, inner, ground)
        vehicle, moment = vehicle + ground[:3], moment + ground[3:6]
        load = load + np.array(ground_on_load(p, x, inner))
    out = np.zeros(STATE_SIZE)
    down, inertia, turning = np.array([0.0, 0.0, p.gravity]), np.array(p.inertia), x[BODY_RATES]
    out[VEHICLE_POSITION], out[LOAD_POSITION] = x[VEHICLE_VELOCITY], x[LOAD_VELOCITY]
    out[VEHICLE_VELOCITY] = vehicle / p.vehicle_mass - down
    out[LOAD_VELOCITY] = load / p.load_mass - down
    w, v = x[6], x[7:10]
    out[6], out[7:10] = -0.5 * v @ turning, 0.5 * (w * turning + np.cross(v, turning))
    out[BODY_RATES] = (moment - np.cross(turning, inertia * turning)) / inertia
    return out


@pytest.mark.parametrize("taut", [True, False])
def test_rates_in_the_air(taut: bool) -> None:
    p, (x, inner), out = record(windy()), moving(), np.zeros(STATE_SIZE)
    dynamics.state_derivative(p, x, inner, WRENCH, taut, FORCE, WIND, np.zeros(7), out)
    np.testing.assert_allclose(out, expected_rates(p, x, inner, WRENCH, taut), rtol=1e-12, atol=1e-12)


def test_rates_on_the_ground() -> None:
    """Both bodies in it, at a height that is not 0."""
    p, (x, inner), out = record(windy(ground={"sink": 0.004, "height": 4.8})), moving(), np.zeros(STATE_SIZE)
    x[ATTITUDE] = Rotation.from_euler("ZYX", (0.3, 0.1, -0.05)).as_quat(scalar_first=True)
    x[LOAD_POSITION] = 1.5, -2.0, 4.83
    dynamics.state_derivative(p, x, inner, WRENCH, False, FORCE, WIND, np.zeros(7), out)
    np.testing.assert_allclose(out, expected_rates(p, x, inner, WRENCH, False), rtol=1e-12, atol=1e-12)
    assert out[5] > 100.0  # the ground pushes
    assert out[18] > 10.0


def test_rates_without_air_and_ground() -> None:
    p, (x, inner), out = record(plain_vehicle()), moving(), np.zeros(STATE_SIZE)
    assert not p.has_drag
    assert not p.has_ground
    dynamics.state_derivative(p, x, inner, WRENCH, True, FORCE, WIND, np.zeros(7), out)
    expected = expected_rates(p, x, inner, WRENCH, True, drags=False)
    np.testing.assert_allclose(out, expected, rtol=1e-12, atol=1e-12)


def test_rates_of_a_state_in_still_air() -> None:
    """As `derivative` has them for whoever differentiates: slack and taut by the state itself."""
    for length in (0.8, 1.3):
        p, (x, inner), out = record(plain_vehicle()), moving(length=length), np.zeros(STATE_SIZE)
        x[LOAD_VELOCITY] = x[VEHICLE_VELOCITY]
        dynamics.derivative(p, x, inner[:MOST_ROTORS], FORCE, out)
        wrench = rotor_wrench(p, inner)
        expected = expected_rates(p, x, inner, wrench, length > 1.0, drags=False)
        np.testing.assert_allclose(out, expected, rtol=1e-12, atol=1e-12)
    two_way, out = record(plain_vehicle(cable={"model": "two-way"})), np.zeros(STATE_SIZE)
    x, inner = moving(length=0.8)
    dynamics.derivative(two_way, x, inner[:MOST_ROTORS], FORCE, out)
    expected = expected_rates(two_way, x, inner, rotor_wrench(two_way, inner), True, drags=False)
    np.testing.assert_allclose(out, expected, rtol=1e-12, atol=1e-12)


# One step


def classic_step(p: Any, x: Array, inner: Array, wrenches: Any, taut: bool, h: float) -> tuple[Array, Array]:
    """The textbook's Runge-Kutta step of bodies and cable together; returns state and the cable's states."""
    count = int(p.cable_states)

    def rates(extended: Array, wrench: Any) -> Array:
        rate, acting, out = np.zeros(STATE_SIZE + count), FORCE.copy(), np.zeros(STATE_SIZE)
        if count:
            flexible_cable(p, extended, True, FORCE, WIND, rate, acting)
        body = extended[:STATE_SIZE]
        dynamics.state_derivative(p, body, inner, wrench, taut, acting, WIND, np.zeros(7), out)
        rate[:STATE_SIZE] = out
        return rate

    y = np.concatenate([x, inner[CABLE_STATE : CABLE_STATE + count]])
    start, middle, end = wrenches
    k1 = rates(y, start)
    k2 = rates(y + 0.5 * h * k1, middle)
    k3 = rates(y + 0.5 * h * k2, middle)
    k4 = rates(y + h * k3, end)
    y = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    y[ATTITUDE] /= np.linalg.norm(y[ATTITUDE])
    return y[:STATE_SIZE], y[STATE_SIZE:]


def lagging(vehicle: Vehicle) -> Vehicle:
    """Every rotor with a lag of its own."""
    rotors = tuple(
        r.model_copy(update={"time_constant": 0.01 * (i + 1)}) for i, r in enumerate(vehicle.rotors)
    )
    return vehicle.model_copy(update={"rotors": rotors})


COMMAND = np.array([200.0, 150.0, 100.0, 50.0, *[0.0] * (MOST_ROTORS - 4)])


def rotor_speeds(vehicle: Vehicle, speed: Array, duration: float) -> Array:
    """First-order lag, exactly."""
    lags = np.array([rotor.time_constant for rotor in vehicle.rotors])
    left = np.exp(-duration / np.maximum(lags, 1e-12))
    return np.asarray(COMMAND[:4] + (speed - COMMAND[:4]) * left)


def whole_step(p: Any, x: Array, inner: Array, h: float) -> Array:
    """One step in place; returns the scratch array."""
    work = np.full(dynamics.WORK_SHAPE, 3.0)
    dynamics.rotor_decay(p, 0.5 * h, work[7])
    dynamics.whole_step(p, x, inner, COMMAND, FORCE, WIND, h, work)
    return work


@pytest.mark.parametrize("lag", [True, False])
@pytest.mark.parametrize("model", ["tension-only", "two-way"])
def test_a_step_is_the_classic_one_with_the_rotors_lag(lag: bool, model: str) -> None:
    vehicle = windy(cable={"damping": 4.0, "model": model})
    vehicle = lagging(vehicle) if lag else vehicle
    p, (x, inner), h = record(vehicle), moving(), 2e-3
    speeds = [inner[:4].copy(), *(rotor_speeds(vehicle, inner[:4], t) for t in (0.5 * h, h))]
    wrenches = [rotor_wrench(p, speed) for speed in speeds]
    expected, _ = classic_step(p, x, inner, wrenches if lag else [wrenches[2]] * 3, True, h)
    whole_step(p, x, inner, h)
    np.testing.assert_allclose(x, expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(inner[:4], speeds[2], rtol=1e-12)
    assert not inner[4:MOST_ROTORS].any()


@pytest.mark.parametrize("model", ["progressive", "chain"])
def test_a_flexible_cable_is_integrated_with_the_bodies(model: str) -> None:
    vehicle = windy(cable=FLEXIBLE[model])
    p, x, inner, h = record(vehicle), initial_state(vehicle), initial_inner_state(vehicle), 5e-4
    x[VEHICLE_VELOCITY], x[LOAD_VELOCITY], x[BODY_RATES] = (0.3, 0.1, 0.2), (-0.5, 0.4, -0.6), (0.1, 0.2, 0.3)
    x[15] -= 0.02
    assert p.cable_states > 0
    expected, states = classic_step(p, x, inner, [rotor_wrench(p, COMMAND)] * 3, False, h)
    whole_step(p, x, inner, h)
    np.testing.assert_allclose(x, expected, rtol=1e-12, atol=1e-12)
    count = int(p.cable_states)
    np.testing.assert_allclose(inner[CABLE_STATE : CABLE_STATE + count], states, rtol=1e-12, atol=1e-13)
    assert not inner[CABLE_STATE + count :].any()


FLEXIBLE: dict[str, dict[str, Any]] = {
    "progressive": {"model": "progressive", "material": "nylon", "diameter": 0.004},
    "chain": {"model": "chain", "segments": 5, "mass": 0.2, "stiffness": 400.0},
}


def test_an_overloaded_cable_breaks_at_the_end_of_the_step() -> None:
    p, (x, inner) = record(windy()), moving()
    p.breaking_tension = 1.0
    assert tension_of(p, x, inner) > 1.0
    whole_step(p, x, inner, 1e-3)
    assert inner[CABLE_HOLDS] == 0.0
    p = record(windy())
    x, inner = moving()
    whole_step(p, x, inner, 1e-3)
    assert inner[CABLE_HOLDS] == 1.0


def test_contacts_slip_at_the_end_of_the_step() -> None:
    p, (x, inner) = record(windy(ground={"sink": 0.004, "height": 4.8})), moving()
    x[ATTITUDE] = Rotation.from_euler("ZYX", (0.3, 0.1, -0.05)).as_quat(scalar_first=True)
    x[LOAD_POSITION], x[VEHICLE_VELOCITY], x[LOAD_VELOCITY] = (1.5, -2.0, 4.83), 0.0, 0.0
    work = whole_step(p, x, inner, 1e-3)
    assert work[5, LOOSE] == 1.0  # the anchors are at the origin, far away
    assert (inner[ANCHOR_EAST : ANCHOR_EAST + 4] > 0.5).all()
    assert inner[ANCHOR_EAST + LOAD_CONTACT] == pytest.approx(1.5, abs=0.02)


def test_legs_that_stick_are_not_loose() -> None:
    """What one step found does not count in the next."""
    vehicle = load_vehicle("iris", ["initial.start=ground"])
    p, x, inner = record(vehicle), initial_state(vehicle), initial_inner_state(vehicle)
    anchors = inner[ANCHOR_EAST:CABLE_HOLDS].copy()
    work = np.full(dynamics.WORK_SHAPE, 3.0)
    dynamics.rotor_decay(p, 5e-4, work[7])
    dynamics.whole_step(p, x, inner, np.zeros(MOST_ROTORS), np.zeros(6), np.zeros(6), 1e-3, work)
    assert work[5, LOOSE] == 0.0
    np.testing.assert_allclose(inner[ANCHOR_EAST:CABLE_HOLDS], anchors, atol=1e-12)


# Slack and taut within a step


def falling(length: float, rate: float, **cable: float) -> tuple[Any, Array, Array]:
    """Two bodies in free fall, the load so far below the vehicle, without rotors; k = 200 N/m, l_0 = 1 m."""
    p = record(plain_vehicle(cable=cable))
    x, inner = np.zeros(STATE_SIZE), np.zeros(INNER_SIZE)
    x[2], x[6], x[15], x[18] = 10.0, 1.0, 10.0 - length, -rate
    inner[CABLE_HOLDS] = 1.0
    return p, x, inner


def flown_length(p: Any, x: Array, inner: Array, step: float, count: int = 1) -> tuple[float, float]:
    """Length of the cable and its rate after some steps, without external force and command."""
    work = np.zeros(dynamics.WORK_SHAPE)
    dynamics.rotor_decay(p, 0.5 * step, work[7])
    for _ in range(count):
        dynamics.whole_step(p, x, inner, np.zeros(MOST_ROTORS), np.zeros(6), np.zeros(6), step, work)
    return stretch(x)


FREQUENCY = math.sqrt(200.0 * (1.0 / 2.0 + 1.0 / 0.7))
"""rad/s, of the two bodies on the cable"""
SPLIT_STEP, CLOSING = 2e-3, 3.0
"""s and m/s"""
ERROR = CLOSING / FREQUENCY * (FREQUENCY * SPLIT_STEP) ** 5 / 60.0
"""m, twice that of one Runge-Kutta step of the swing: amplitude times (w h)^5 / 120"""


@pytest.mark.parametrize("share", [0.001, 0.3, 0.999])
def test_a_cable_that_snaps_taut_within_a_step_swings_from_there_on(share: float) -> None:
    """Free until l_0 at the rate v, then v / w sin w t: to the step's own error."""
    step, rate = SPLIT_STEP, CLOSING
    p, x, inner = falling(1.0 - share * step * rate, rate)
    length, speed = flown_length(p, x, inner, step)
    rest = FREQUENCY * (1.0 - share) * step
    assert length == pytest.approx(1.0 + rate / FREQUENCY * math.sin(rest), abs=ERROR)
    assert speed == pytest.approx(rate * math.cos(rest), abs=FREQUENCY * ERROR)


@pytest.mark.parametrize("share", [0.001, 0.3, 0.999])
def test_a_cable_that_goes_slack_within_a_step_flies_on_freely(share: float) -> None:
    step, rate = SPLIT_STEP, CLOSING
    before = FREQUENCY * share * step
    p, x, inner = falling(1.0 + rate / FREQUENCY * math.sin(before), -rate * math.cos(before))
    length, speed = flown_length(p, x, inner, step)
    assert length == pytest.approx(1.0 - rate * (1.0 - share) * step, abs=ERROR)
    assert speed == pytest.approx(-rate, abs=FREQUENCY * ERROR)


def test_a_snatch_shorter_than_a_step_is_not_missed_where_the_step_ends_in_it() -> None:
    """Taut, slack and past the turn: the whole bounce gives the rate back."""
    p, x, inner = falling(0.9999, 3.0)
    step = 2e-3
    length, speed = flown_length(p, x, inner, step, 100)
    swing = math.pi / FREQUENCY
    assert length == pytest.approx(1.0 - 3.0 * (100 * step - 1e-4 / 3.0 - swing), abs=1e-6)
    assert speed == pytest.approx(-3.0, abs=1e-6)


def test_the_rotors_spin_on_through_a_split_step() -> None:
    vehicle = lagging(plain_vehicle())
    _, x, inner = falling(0.9985, 3.0)
    p, step = record(vehicle), 1e-3
    inner[:4] = 100.0, 110.0, 120.0, 130.0
    expected = rotor_speeds(vehicle, inner[:4], step)
    fine, fine_inner = x.copy(), inner.copy()
    whole_step(p, x, inner, step)
    np.testing.assert_allclose(inner[:4], expected, rtol=1e-9)
    for _ in range(50):
        whole_step(p, fine, fine_inner, step / 50)
    np.testing.assert_allclose(x, fine, atol=1e-8)


def test_a_two_way_cable_is_never_split() -> None:
    p, x, inner = falling(0.997, 3.0, model="two-way")  # type: ignore[arg-type]
    length, _ = flown_length(p, x, inner, 2e-3)
    phase = FREQUENCY * 2e-3
    expected = 1.0 - 0.003 * math.cos(phase) + 3.0 / FREQUENCY * math.sin(phase)
    assert length == pytest.approx(expected, abs=1e-9)


# Many steps


def test_each_step_takes_its_rows_of_forces_and_winds() -> None:
    """Row k from step k·hold on, the first step counted from row 0, the two tables each at its own hold."""
    p = record(windy())
    rng = np.random.default_rng(6)
    forces, winds = (rng.normal(size=(dynamics.TABLE_ROWS, 6)) for _ in range(2))
    x, inner = moving()
    one, one_inner = x.copy(), inner.copy()
    work = np.zeros(dynamics.WORK_SHAPE)
    h, first_force, first_wind, force_hold, wind_hold, steps = 1e-3, 7, 4, 3, 2, 11
    rotors = np.zeros(MOST_ROTORS)
    rotors[:4] = 120.0
    given = (first_force, first_wind, force_hold, wind_hold, steps, h)
    assert dynamics.advance.python([p], x, inner, rotors, forces, winds, work, *given) == steps
    dynamics.rotor_decay(p, 0.5 * h, work[7])
    for k in range(steps):
        force = forces[(first_force + k) // force_hold]
        wind = winds[(first_wind + k) // wind_hold]
        dynamics.whole_step(p, one, one_inner, rotors, force, wind, h, work)
    np.testing.assert_array_equal(x, one)
    np.testing.assert_array_equal(inner, one_inner)


def test_gripper_and_winch_work_in_each_step() -> None:
    vehicle = plain_vehicle(
        winch={
            "rate": 0.5,
            "time_constant": 0.01,
            "min_length": 0.5,
            "max_length": 3.0,
            "stall_tension": 50.0,
        },
        gripper={"release_time": 0.004, "reach": 0.1},
    )
    p, (x, inner) = record(vehicle), moving()
    controls = np.zeros(MOST_ROTORS)
    controls[4:7] = -1.0, 1.0, 0.0
    speeds = np.zeros(MOST_ROTORS)
    dynamics.set_rotors.python([p], controls, np.ones(MOST_ROTORS), speeds)
    tables = (np.zeros((dynamics.TABLE_ROWS, 6)), np.zeros((dynamics.TABLE_ROWS, 6)))
    work = np.zeros(dynamics.WORK_SHAPE)
    dynamics.advance.python([p], x, inner, speeds, *tables, work, 0, 0, 99, 99, 3, 1e-3)
    assert inner[CABLE_HOLDS] == 1.0
    lag = [0.5 * (1.0 - math.exp(-k * 1e-3 / 0.01)) for k in (1, 2, 3)]
    assert p.reel_rate == pytest.approx(lag[2])
    assert p.rest_length == pytest.approx(1.0 + 1e-3 * sum(lag))
    dynamics.advance.python([p], x, inner, speeds, *tables, work, 0, 0, 99, 99, 1, 1e-3)
    assert inner[CABLE_HOLDS] == 0.0


def test_what_is_declared_to_the_compiler_fits_what_is_flown() -> None:
    record, rotors, table = np.zeros(1, dtype=PARAMETERS), np.zeros(MOST_ROTORS), np.zeros((1024, 6))
    state, inner, work = np.zeros(STATE_SIZE), np.zeros(INNER_SIZE), np.zeros(dynamics.WORK_SHAPE)
    advanced = (record, state, inner, rotors, table, table, work)
    for entry, arrays in (
        (dynamics.advance, advanced),
        (dynamics.set_rotors, (record, rotors, rotors, rotors)),
    ):
        for declared, array in zip(entry.arguments, arrays, strict=False):
            assert (np.dtype(declared.dtype), declared.shape) == (array.dtype, array.shape)
        assert entry.buffers == len(arrays)
    assert dynamics.WORK_SHAPE[0] > 11  # rows that are named at the top


# What is measured


@pytest.mark.parametrize("taut", [True, False])
def test_reactions_in_the_air(taut: bool) -> None:
    p, (x, inner) = record(windy()), moving(length=1.3 if taut else 0.8)
    x[LOAD_VELOCITY] = x[VEHICLE_VELOCITY]
    reactions = np.full(REACTIONS_SIZE, 7.0)
    work = np.full(dynamics.WORK_SHAPE, 7.0)
    dynamics.fill_reactions(p, x, inner, FORCE, WIND, work, reactions)
    rates = expected_rates(p, x, inner, rotor_wrench(p, inner), taut)
    felt = rotation(x).T @ (rates[VEHICLE_VELOCITY] + [0.0, 0.0, 9.81])
    np.testing.assert_allclose(reactions[SPECIFIC_FORCE], felt, rtol=1e-10)
    np.testing.assert_allclose(reactions[ANGULAR_ACCELERATION], rates[BODY_RATES], rtol=1e-10)
    assert reactions[TENSION] == pytest.approx(60.0 if taut else 0.0)
    assert reactions[VEHICLE_GROUND_FORCE] == 0.0
    assert reactions[LOAD_GROUND_FORCE] == 0.0


def test_reactions_on_the_ground() -> None:
    p, (x, inner) = record(windy(ground={"sink": 0.004, "height": 4.8})), moving()
    x[ATTITUDE] = Rotation.from_euler("ZYX", (0.3, 0.1, -0.05)).as_quat(scalar_first=True)
    x[LOAD_POSITION] = 1.5, -2.0, 4.83
    reactions, ground = np.full(REACTIONS_SIZE, 7.0), np.zeros(7)
    dynamics.fill_reactions(p, x, inner, FORCE, WIND, np.zeros(dynamics.WORK_SHAPE), reactions)
    ground_on_vehicle(p, x, inner, ground)
    assert reactions[VEHICLE_GROUND_FORCE] == pytest.approx(ground[2])
    assert reactions[LOAD_GROUND_FORCE] == pytest.approx(ground_on_load(p, x, inner)[2])
    assert ground[2] > 100.0


def test_reactions_of_a_flexible_cable() -> None:
    """The vehicle feels the rope that it carries."""
    vehicle = plain_vehicle(cable=FLEXIBLE["progressive"], initial={"vehicle_position": [0.0, 0.0, 1.02]})
    p, x, inner = record(vehicle), initial_state(vehicle), initial_inner_state(vehicle)
    reactions = np.zeros(REACTIONS_SIZE)
    dynamics.fill_reactions(p, x, inner, np.zeros(6), np.zeros(6), np.zeros(dynamics.WORK_SHAPE), reactions)
    tension = tension_of(p, x, inner)
    lift = rotor_wrench(p, inner)[0]
    assert reactions[TENSION] == tension > vehicle.load.mass * 9.81
    assert reactions[2] == pytest.approx((lift - tension) / vehicle.airframe.mass, rel=1e-9)


# Commands


def test_controls_become_rotor_speeds() -> None:
    p = record(plain_vehicle())
    controls = np.full(MOST_ROTORS, 0.5)
    controls[:4] = 0.25, -0.5, 1.5, math.nan
    controls[4] = math.inf
    share, speeds = np.ones(MOST_ROTORS), np.full(MOST_ROTORS, 9.0)
    share[0] = 0.5
    assert dynamics.set_rotors.python([p], controls, share, speeds) == 0
    assert speeds[:4].tolist() == [0.5 * 500.0, 0.0, 2000.0, 0.0]
    assert not speeds[4:].any()
