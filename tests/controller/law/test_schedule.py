"""Gains by the size of the error: what is between stiff and soft, and when."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.design.catalogue import default_weights, design, design_for, stiffened, stiffness
from controller.design.later import acting_later
from controller.design.motion.ramp import planned
from controller.design.softer_far_off import FAR, NEAR, at_share, leaning
from controller.law.control_law import FEEDFORWARD, WORK, Design, engaged_memory
from controller.law.control_step import law_step
from controller.law.reference import Path, setpoint
from controller.law.schedule import GAINS, SIZED, stiff_share
from controller.law.state import EULER_ANGLES, LOAD_POSITION, STATE_SIZE, VEHICLE_POSITION, Array
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.closed_loop import fly
from tests.controller.fleet import FLEET, attributes, delayed

RATE = 250.0
ORIGIN = (0.0, 0.0, 0.0)
LEVEL = [i for i in range(SIZED) if i % 3 < 2]


def share_at(record: Design, deviation: Array) -> float:
    work = attributes(np.zeros(1, dtype=WORK))
    work.deviation[:SIZED] = deviation
    return float(stiff_share(attributes(record).soft, work))


def size(record: Design, deviation: Array) -> float:
    return float(np.sqrt(deviation @ record["soft"]["form"][0] @ deviation))


@pytest.mark.parametrize("name", ["paper", "paper, 10 m", "small"])
def test_the_size_bounds_the_lean_that_is_asked_for(name: str) -> None:
    record = design("default", FLEET[name], RATE)
    lean, closest = leaning(record), 0.0
    worst = np.linalg.pinv(record["soft"]["form"][0]) @ lean.T  # where the lean is largest for its size
    for deviation in [*worst.T, *np.random.default_rng(1).normal(size=(200, SIZED))]:
        level = np.zeros(SIZED)
        level[LEVEL] = deviation[LEVEL]
        asked = float(np.linalg.norm(lean @ level))
        assert asked <= size(record, level) * (1.0 + 1e-9)
        closest = max(closest, asked / size(record, level))
    assert closest > 0.999  # it is no larger than it has to be


def test_the_share_falls_smoothly_from_near_to_far() -> None:
    record = design("default", FLEET["paper"], RATE)
    unit = np.zeros(SIZED)
    unit[LOAD_POSITION.start] = 1.0
    unit /= size(record, unit)
    shares = [share_at(record, angle * unit) for angle in np.linspace(0.0, 1.2 * FAR, 200)]
    assert shares[0] == 1.0
    assert shares[-1] == 0.0
    assert share_at(record, 0.999 * NEAR * unit) == 1.0
    assert share_at(record, 0.5 * (NEAR + FAR) * unit) == pytest.approx(0.5)
    steps = -np.diff(shares)
    assert np.all(steps >= 0.0)
    assert steps.max() < 1.6 * 1.2 * FAR / (FAR - NEAR) / len(steps)  # 1.5 is the steepest


def test_what_is_no_number_is_not_soft_nor_stiff_without_end() -> None:
    record = design("default", FLEET["paper"], RATE)
    assert share_at(record, np.full(SIZED, math.nan)) == 1.0  # the wrench is none, and the rotors stop
    assert share_at(record, np.full(SIZED, 1e100)) == 0.0


@pytest.mark.parametrize("name", ["paper", "paper, 10 m", "small, lag"])
def test_its_ends_are_two_designs(name: str) -> None:
    vehicle = delayed(FLEET[name], 1)
    record = design("default", vehicle, RATE)
    share = stiffness(vehicle, RATE)
    assert share > 0.0
    for end, factors in ((1.0, share), (0.0, 0.0)):
        like = design_for(vehicle, RATE, default_weights(vehicle, stiffened(factors)), FEEDFORWARD)
        found = at_share(record, end)
        for gain in GAINS.names or ():
            scale = float(np.abs(like[gain]).max()) + 1e-30
            np.testing.assert_allclose(found[gain], like[gain], atol=1e-9 * scale, err_msg=gain)


@pytest.mark.parametrize("name", ["paper", "small, lag"])
def test_when_commands_act_later_both_ends_follow(name: str) -> None:
    vehicle = FLEET[name]
    record = design("default", vehicle, RATE)
    later = acting_later(record, vehicle, 5)
    for end in (0.0, 1.0):
        like, found = acting_later(at_share(record, end), vehicle, 5), at_share(later, end)
        for gain in GAINS.names or ():
            scale = float(np.abs(like[gain]).max()) + 1e-30
            np.testing.assert_allclose(found[gain], like[gain], atol=1e-9 * scale, err_msg=gain)


def test_what_an_integral_holds_does_not_change_with_the_share() -> None:
    record = design("default", FLEET["paper"], RATE)[0]
    soft = record["soft"]["gains"]
    for axis, k in ((0, 2), (1, 1), (2, 0)):
        tilt = EULER_ANGLES.start + k - 1
        held = [
            gains["integral_gain"][k, axis] / (gains["state_gain"][k, tilt] if k else 1.0)
            for gains in (record, soft)
        ]
        assert held[0] == pytest.approx(held[1], rel=1e-9)


def gains_in_use(vehicle: Vehicle, path: Path, seconds: float) -> float:
    """Share of the stiff gains on the reference itself."""
    record = design("default", vehicle, RATE)
    law, memory, work = (
        attributes(one) for one in (record, engaged_memory(np.zeros(3)), np.zeros(1, dtype=WORK))
    )
    estimate = np.zeros(STATE_SIZE)
    for _ in range(2):  # the second time on the reference
        memory.ticks = round(seconds * RATE)
        law_step(law, memory, attributes(path), estimate, work)
        estimate = np.array(work.desired)
    stiff, soft, now = (one.state_gain[1, EULER_ANGLES.start] for one in (law, law.soft.gains, work.gains))
    return float((now - soft) / (stiff - soft))


def test_along_a_fast_motion_the_gains_are_soft_and_at_its_end_stiff() -> None:
    vehicle = FLEET["paper"]
    path = planned(setpoint((3.0, 5.0, 2.0), ORIGIN), vehicle)
    duration = float(path["ramp_time"][0])
    assert gains_in_use(vehicle, path, 0.5 * duration) == pytest.approx(0.0, abs=1e-9)
    assert gains_in_use(vehicle, path, duration + 5.0) == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["paper", "paper, 10 m"])
def test_it_catches_a_swing_that_the_stiff_law_makes_worse(name: str) -> None:
    reach = FLEET[name].hover_length
    aside = [reach * math.sin(0.5), 0.0, reach * math.cos(0.5)]
    length = FLEET[name].cable.rest_length
    vehicle = load_vehicle("paper", [f"cable.rest_length={length}", f"initial.vehicle_position={aside}"])
    scheduled = design("default", vehicle, RATE)
    ends = []
    for record in (scheduled, at_share(scheduled, 1.0)):
        last = fly(vehicle, record, setpoint(ORIGIN, ORIGIN), 20.0, RATE).states[-1]
        ends.append(float(np.linalg.norm((last[VEHICLE_POSITION] - last[LOAD_POSITION])[:2])))
    assert ends[0] < 0.01 * reach
    if name == "paper, 10 m":
        assert ends[1] > 0.03 * reach
