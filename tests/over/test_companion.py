"""The companion: its law's loop, its filter, and its manners against a stack that a test plays."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mavlink

from controller.law.reference import Path, setpoint
from controller.over.law import stable
from controller.over.load_source import load_source
from controller.over.pendulum_filter import PendulumFilter
from controller.over.session import OUR_SYSTEM, Companion, State
from controller.over.stack import Stack, full_thrust, thrust_setpoint
from sitl_bridge.mavlink.framing import Packer, decode, split
from sitl_bridge.plant.physics.state import SPECIFIC_FORCE
from sitl_bridge.plant.physics.world import World
from sitl_bridge.vehicle.files import load_vehicle

IRIS = load_vehicle("iris", ["initial.start=hover", "initial.load_position=[0,0,2.5]"])
OFFBOARD, HOLD, LAND = 6 << 16, 4 << 16 | 3 << 24, 4 << 16 | 6 << 24


@settings(max_examples=25, deadline=None)
@given(
    rate_lag=st.floats(0.03, 0.12),
    thrust_lag=st.floats(0.02, 0.1),
    delay=st.floats(0.0, 0.06),
    length=st.floats(0.5, 15.0),
)
def test_the_sampled_loop_is_stable_for_stacks_and_cables(
    rate_lag: float, thrust_lag: float, delay: float, length: float
) -> None:
    vehicle = load_vehicle("iris", ["initial.start=hover", f"cable.rest_length={length}"])
    assert stable(vehicle, Stack(rate_lag=rate_lag, thrust_lag=thrust_lag, delay=delay)) < 1.0


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


class PlayedStack:
    """Answers as PX4 does; a vehicle that stands still where it is told to."""

    def __init__(self) -> None:
        self._packer = Packer(1, 1)
        self.mode, self.armed, self.height, self.now = 0, False, 0.1, 0.0
        self.accepts_offboard = True
        self.frozen = False
        self.setpoints: list[Any] = []
        self.commands: list[Any] = []
        self._ticks = 0

    def receive(self, datagram: bytes) -> list[bytes]:
        out = []
        for frame in split(datagram).frames:
            assert frame.system == OUR_SYSTEM
            message = decode(frame)
            if message.get_type() == "SET_ATTITUDE_TARGET":
                self.setpoints.append(message)
            elif message.get_type() == "PARAM_REQUEST_READ":
                out.append(mavlink.MAVLink_param_value_message(b"THR_MDL_FAC", 1.0, 9, 1, 0))
            elif message.get_type() == "COMMAND_LONG":
                self.commands.append(message)
                out.append(mavlink.MAVLink_command_ack_message(message.command, self._obey(message)))
        return [self._packer.pack(message) for message in out]

    def _obey(self, message: Any) -> int:
        if message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            self.armed = True
        elif message.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            self.height = message.param7 - 488.0
        elif message.command == mavlink.MAV_CMD_DO_SET_MODE:
            mode = int(message.param2) << 16 | int(message.param3) << 24
            if mode == OFFBOARD and not (self.accepts_offboard and self.setpoints):
                return int(mavlink.MAV_RESULT_DENIED)
            self.mode = mode
            self.armed = self.armed and mode != LAND
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def tick(self) -> bytes:
        """10 ms of telemetry."""
        self.now += 0.01
        self._ticks += 1
        flag = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        out = []
        if self._ticks % 50 == 1:
            out.append(mavlink.MAVLink_heartbeat_message(2, 12, 1 | flag, self.mode, 4, 3))
            height = round(1000 * self.height)
            out.append(
                mavlink.MAVLink_global_position_int_message(1, 0, 0, 488_000 + height, height, 0, 0, 0, 0)
            )
        if not self.frozen:
            nan = [math.nan] + [0.0] * 20
            zeros = (0.0,) * 6
            out.append(
                mavlink.MAVLink_odometry_message(
                    round(1e6 * self.now), 1, 12, 0.0, 0.0, -self.height, [1, 0, 0, 0], *zeros, nan, nan
                )
            )
        return b"".join(self._packer.pack(message) for message in out)


class Flight:
    def __init__(self, duration: float = 2.0) -> None:
        self.stack, self.said = PlayedStack(), list[str]()

        def path(start: tuple[float, float, float]) -> Path:
            return setpoint(start, start)

        source = load_source("none", IRIS)
        self.companion = Companion(IRIS, Stack(), source, path, duration, self.said.append)

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        for _ in range(round(100 * seconds)):
            self.companion.receive(self.stack.tick(), self.stack.now)
            for datagram in self.companion.to_send(self.stack.now):
                for answer in self.stack.receive(datagram):
                    self.companion.receive(answer, self.stack.now)
            if until():
                return


def test_a_whole_flight() -> None:
    flight = Flight()
    flight.run(60.0, lambda: flight.companion.state is State.DONE)
    assert flight.companion.state is State.DONE, (flight.companion.state, flight.said)
    modes = [m for m in flight.stack.commands if m.command == mavlink.MAV_CMD_DO_SET_MODE]
    assert [int(m.param2) for m in modes] == [6, 4, 4]
    hover = thrust_setpoint(IRIS.hover_thrust, full_thrust(IRIS, Stack()), 1.0)
    assert flight.stack.setpoints[0].thrust == pytest.approx(hover)
    assert {m.type_mask for m in flight.stack.setpoints} == {mavlink.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE}
    assert flight.companion.steps > 150


def flying() -> Flight:
    flight = Flight(duration=60.0)
    flight.run(60.0, lambda: flight.companion.state is State.FLYING and flight.companion.steps > 20)
    assert flight.companion.state is State.FLYING, flight.said
    return flight


def test_it_stops_at_once_when_the_operator_takes_another_mode() -> None:
    flight = flying()
    flight.stack.mode = HOLD
    flight.run(1.0)
    assert flight.companion.state is State.FAILED
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
    assert flight.companion.state is State.FAILED
    assert "older than" in flight.said[-1]


def test_a_stack_that_refuses_offboard_is_said_and_ends_it() -> None:
    flight = Flight()
    flight.stack.accepts_offboard = False
    flight.run(80.0, lambda: flight.companion.state is State.FAILED)
    assert flight.companion.state is State.FAILED
    assert any("denied" in text for text in flight.said)
    assert "offboard" in flight.said[-1]


@given(st.binary(max_size=300))
def test_no_datagram_upsets_it(data: bytes) -> None:
    flight = Flight()
    flight.companion.receive(data, 0.0)
    assert flight.companion.state is State.CONNECTING
