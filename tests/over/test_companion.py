"""The companion: its law's loop, its filter, and its manners against a stack that a test plays."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mavlink

from controller.over.ages import LONGEST_STANDSTILL, Ages
from controller.over.load.pendulum_filter import PendulumFilter
from controller.over.model import Steering, stable
from controller.over.stack import AttitudeGains, Stack, full_thrust, thrust_setpoint
from controller.over.states import State
from controller.over.telemetry import ClockOffset
from sitl_bridge.frames import attitude_to_enu_flu, euler_from_quaternion
from sitl_bridge.plant.physics.state import SPECIFIC_FORCE
from sitl_bridge.plant.physics.world import World
from sitl_bridge.vehicle.files import load_vehicle
from tests.over.played import HOLD, IRIS, LAND, MANUAL, Played


@settings(max_examples=25, deadline=None)
@given(
    rate_lag=st.floats(0.03, 0.12),
    thrust_lag=st.floats(0.02, 0.1),
    delay=st.floats(0.0, 0.06),
    length=st.floats(0.5, 15.0),
    accurate=st.booleans(),
    attitude=st.none() | st.builds(AttitudeGains, st.floats(1.0, 12.0), st.floats(0.5, 5.0)),
)
def test_the_sampled_loop_is_stable_for_stacks_and_cables(
    rate_lag: float,
    thrust_lag: float,
    delay: float,
    length: float,
    accurate: bool,
    attitude: AttitudeGains | None,
) -> None:
    vehicle = load_vehicle("iris", ["initial.start=hover", f"cable.rest_length={length}"])
    stack = Stack(rate_lag=rate_lag, thrust_lag=thrust_lag, delay=delay)
    assert stable(vehicle, stack, accurate, attitude) < 1.0


def test_an_attitude_is_asked_for_by_choice() -> None:
    """With the gains that the stack's parameters say; where it leans is where the force of the law points."""
    flight = Played(duration=60.0, steering=Steering.ATTITUDE)
    flight.stack.parameters |= {"MC_ROLL_P": 5.0, "MC_YAW_P": 2.0}
    flight.run(60.0, lambda: flight.flight.state is State.FLYING and flight.flight.steps > 20)
    assert flight.flight.design.attitude == AttitudeGains(5.0, 2.0)
    asked = flight.stack.setpoints[-1]
    assert asked.type_mask == 0b111
    assert (asked.body_roll_rate, asked.body_pitch_rate, asked.body_yaw_rate) == (0.0, 0.0, 0.0)
    euler = euler_from_quaternion(attitude_to_enu_flu(tuple(asked.q)))
    state = flight.flight.telemetry.vehicle
    assert state is not None
    assert euler[2] == pytest.approx(euler_from_quaternion(state.attitude)[2], abs=0.1)
    assert math.hypot(*euler[:2]) < 0.3


@given(force=st.floats(0.5, 28.0), curve=st.floats(0.0, 1.0))
def test_the_thrust_set_point_gives_the_force(force: float, curve: float) -> None:
    """PX4: a set-point s² f + s (1 - f) turns the rotors at the share s of their largest speed."""
    full = full_thrust(IRIS, Stack())
    wanted = thrust_setpoint(force, full, curve)
    speed = math.sqrt(force / full)
    assert wanted == pytest.approx(curve * speed**2 + (1.0 - curve) * speed)
    assert 0.0 <= wanted <= 1.0


def test_the_filter_finds_a_swinging_load_without_a_load_sensor() -> None:
    swinging = load_vehicle("iris", [*("initial.start=hover", "initial.load_position=[0,0,20]")])
    world = World(swinging, 250.0, seed=0)
    world.state[16:19] = (1.0, -0.5, 0.0)
    filtered = PendulumFilter(swinging, tuple(world.state[0:3].tolist()), tuple(world.state[3:6].tolist()))
    world.command(world.trim_controls)
    noise = np.random.default_rng(1)
    errors = []
    for tick in range(500):
        world.advance(world.steps_per_tick)
        if tick % 2:
            continue
        world.measure(tick, False)
        x = world.state
        place, velocity, attitude = (
            tuple(x[part].tolist()) for part in (slice(0, 3), slice(3, 6), slice(6, 10))
        )
        filtered.predict(place, velocity, 0.008)
        felt = world.reactions[SPECIFIC_FORCE] + noise.normal(0.0, 0.1, 3)
        filtered.feel(attitude, place, velocity, tuple(felt.tolist()))
        errors.append(float(np.linalg.norm(filtered.state[0:3] - x[13:16])))
    assert max(errors) > 0.02  # it did not know at first
    assert np.mean(errors[150:]) < 0.05


def test_a_whole_flight() -> None:
    flight = Played()
    flight.run(60.0, lambda: flight.flight.state is State.DONE)
    assert flight.flight.state is State.DONE, (flight.flight.state, flight.said)
    modes = [m for m in flight.stack.commands if m.command == mavlink.MAV_CMD_DO_SET_MODE]
    assert [int(m.param2) for m in modes] == [6, 4, 4]
    hover = thrust_setpoint(IRIS.hover_thrust, full_thrust(IRIS, Stack()), 1.0)
    assert flight.stack.setpoints[0].thrust == pytest.approx(hover)
    assert {m.type_mask for m in flight.stack.setpoints} == {mavlink.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE}
    assert flight.flight.steps > 150


def flying() -> Played:
    flight = Played(duration=60.0)
    flight.run(60.0, lambda: flight.flight.state is State.FLYING and flight.flight.steps > 20)
    assert flight.flight.state is State.FLYING, flight.said
    return flight


def test_it_stops_at_once_when_the_operator_takes_another_mode() -> None:
    flight = flying()
    flight.stack.mode = HOLD
    flight.run(1.0)
    assert flight.flight.state is State.FAILED
    before = len(flight.stack.setpoints)
    flight.run(1.0)
    assert len(flight.stack.setpoints) == before
    assert "another mode" in flight.said[-1]


def test_it_sends_nothing_on_an_old_state() -> None:
    flight = flying()
    flight.stack.frozen = True
    before = len(flight.stack.setpoints)
    flight.run(1.0)
    assert len(flight.stack.setpoints) <= before + 1
    assert flight.flight.state is State.FAILED
    assert "older than" in flight.said[-1]


def test_a_stack_that_refuses_offboard_is_said_and_ends_it() -> None:
    flight = Played()
    flight.stack.accepts_offboard = False
    flight.run(80.0, lambda: flight.flight.state is State.FAILED)
    assert flight.flight.state is State.FAILED
    assert any("denied" in text for text in flight.said)
    assert "offboard" in flight.said[-1]


@given(st.binary(max_size=300))
def test_no_datagram_upsets_it(data: bytes) -> None:
    flight = Played()
    flight.companion.receive(data, 0.0)
    assert flight.flight.state is State.CONNECTING


def test_without_a_stack_it_says_what_is_missing_and_ends() -> None:
    flight = Played(wait_s=15.0)
    for k in range(200):
        flight.companion.to_send(0.1 * k)
    assert flight.flight.state is State.FAILED
    assert flight.said[0].startswith("still waiting for a HEARTBEAT of an autopilot")
    assert "waited 15 s for a HEARTBEAT of an autopilot" in flight.said[-1]


def test_a_stack_that_does_not_arm_is_quoted() -> None:
    flight = Played()
    flight.stack.arms = False
    flight.run(90.0, lambda: flight.companion.over)
    assert flight.flight.failure is not None
    assert "for the stack to arm" in flight.flight.failure
    assert (
        "Preflight Fail: no GPS lock, and this text is longer than fifty characters" in flight.flight.failure
    )


def test_a_stack_without_position_is_told_from_one_that_is_not_there() -> None:
    flight = Played(wait_s=5.0)
    flight.stack.frozen = True
    flight.run(20.0, lambda: flight.companion.over)
    assert flight.flight.failure is not None
    assert "ODOMETRY" in flight.flight.failure
    assert "HEARTBEAT" not in flight.flight.failure


def test_an_operator_who_takes_over_during_the_landing_keeps_the_vehicle() -> None:
    flight = Played()
    flight.stack.lands = False
    flight.run(60.0, lambda: flight.flight.state is State.LANDING and flight.stack.mode == LAND)
    flight.stack.mode = MANUAL
    commands = len(flight.stack.commands)
    flight.run(5.0)
    assert flight.flight.state is State.FAILED
    assert len(flight.stack.commands) == commands


def test_clocks_that_do_not_keep_pace_tell_no_age() -> None:
    steady, slow = ClockOffset(), ClockOffset()
    for k in range(10):
        now = 0.5 * k
        steady.sample(now - 0.002, 100.0 + now - 0.001, now)
        slow.sample(now - 0.002, 100.0 + 0.5 * now, now)
    age = steady.age(100.0 + 4.3, 4.5)
    assert age == pytest.approx(0.2, abs=1e-3)
    assert slow.age(100.0, 4.5) is None


def test_nothing_ages_while_a_simulated_world_stands_still() -> None:
    world: list[float | None] = [None]
    ages = Ages(lambda: world[0])
    assert ages.age("state", 0.0) == math.inf
    ages.mark("state", 10.0)
    assert ages.age("state", 10.5) == pytest.approx(0.5)  # no world is known
    world[0] = 3.0
    ages.mark("state", 11.0)
    assert ages.age("state", 11.5) == 0.0
    world[0] = 3.3
    assert ages.age("state", 11.5) == pytest.approx(0.3)
    assert ages.age("state", 11.2) == pytest.approx(0.2)  # faster than real time
    assert ages.age("state", 11.0 + 2.1 * LONGEST_STANDSTILL) > LONGEST_STANDSTILL  # dead


def test_what_a_stack_would_do_without_us_is_said() -> None:
    flight = Played()
    flight.stack.parameters |= {"COM_OF_LOSS_T": 1.0, "COM_OBL_RC_ACT": 0}
    flight.run(10.0, lambda: flight.flight.state is State.ARMING)
    assert any("COM_OF_LOSS_T is 1 s" in text for text in flight.said)
    assert any("COM_OBL_RC_ACT is 0" in text for text in flight.said)
    safe = Played()
    safe.stack.parameters |= {"COM_OF_LOSS_T": 0.3, "COM_OBL_RC_ACT": 5}
    safe.run(10.0, lambda: safe.flight.state is State.ARMING)
    assert not any("companion die" in text for text in safe.said)
