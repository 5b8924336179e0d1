"""A motion that is planned before the first tick, and flown from where the load is found."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.design.motion import prepared, ramp
from controller.design.motion.prepared import MORE_THRUST, MORE_TILT, PreparedMotion, adapted
from controller.design.motion.ramp import Demand, demand, planned
from controller.law.reference import Path, circle, setpoint
from controller.law.state import LOAD_POSITION, STATE_SIZE, VEHICLE_POSITION
from controller.pilot.autopilot import Autopilot
from sitl_bridge.vehicle.files import load_vehicle

Triple = tuple[float, float, float]
TARGET: Triple = (3.0, 5.0, 2.0)
PAPER = load_vehicle("paper", [])
ORIGIN: Triple = PAPER.initial_load_position


def to_target(start: Triple) -> Path:
    return setpoint(TARGET, start)


EXPECTED = planned(to_target(ORIGIN), PAPER)


def test_from_the_expected_start_it_is_the_planned_motion() -> None:
    motion = PreparedMotion(to_target(ORIGIN), PAPER, estimated=False)
    assert motion.planned(to_target(ORIGIN)) == planned(to_target(ORIGIN), PAPER)


def asked_of(path: Path) -> Demand:
    duration = float(path["ramp_time"][0])
    return demand(path, PAPER, duration, np.linspace(0.0, duration, 1000))


@settings(max_examples=60, deadline=None)
@given(offset=st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_from_a_start_nearby_it_asks_for_little_more(offset: Triple) -> None:
    start = (ORIGIN[0] + offset[0], ORIGIN[1] + offset[1], ORIGIN[2] + offset[2])
    path = adapted(EXPECTED, to_target(start), PAPER)
    if path is None:
        assert np.linalg.norm(offset) > 0.15
        return
    assert path["start"][0].tolist() == list(start)
    assert path["ramp_time"][0] <= 1.4 * EXPECTED["ramp_time"][0]
    asked, before = asked_of(path), asked_of(EXPECTED)
    assert asked.tilt < 1.02 * MORE_TILT * before.tilt
    assert asked.thrust < 1.02 * MORE_THRUST * before.thrust
    assert asked.tension > 0.4 * before.tension


@pytest.mark.parametrize("start", [(-20.0, 0.0, 0.0), (2.0, 4.0, 1.0), TARGET], ids=["far", "near", "there"])
def test_from_another_start_it_is_planned_again(start: Triple) -> None:
    assert adapted(EXPECTED, to_target(start), PAPER) is None
    motion = PreparedMotion(to_target(ORIGIN), PAPER, estimated=False)
    assert motion.planned(to_target(start)) == planned(to_target(start), PAPER)


def test_another_goal_is_planned_again() -> None:
    assert adapted(EXPECTED, setpoint((3.0, 5.0, 2.1), ORIGIN), PAPER) is None
    onto = planned(circle(TARGET, 2.0, 0.5, ORIGIN), PAPER)
    assert adapted(onto, circle(TARGET, 2.0, 0.5, (0.1, 0.0, 0.0)), PAPER) is None
    same = adapted(onto, circle(TARGET, 2.0, 0.5, ORIGIN), PAPER)
    assert same == onto


def test_the_first_control_step_does_not_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    autopilot = Autopilot(PAPER, "default", 250.0, to_target, np.zeros(16))
    for module, name in ((prepared, "planned"), (ramp, "fastest")):
        monkeypatch.setattr(module, name, None)
    estimate = np.zeros(STATE_SIZE)
    estimate[VEHICLE_POSITION] = PAPER.initial_vehicle_position
    estimate[LOAD_POSITION] = np.float32(np.array(ORIGIN) + 1e-4)
    autopilot.step(estimate, 0, 0.0)
    assert autopilot.armed
