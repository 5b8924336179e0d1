"""The companion's side of the link to a flight stack, as a protocol object without I/O.

It waits for the stack, arms it and takes off, streams set-points, takes over in offboard, flies the
reference, hands back and lands. It stops sending when the stack's state is old, the vehicle is out of its
envelope, or the operator has taken another mode. The stack's own failsafe then holds.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import common as mavlink

from controller.design.ramp import planned
from controller.feedback.truth import PathFrom
from controller.law.state import EULER_ANGLES, LOAD_POSITION, VEHICLE_VELOCITY, Array
from controller.over import dialects
from controller.over.dialects import DIALECTS, ModeNumbers
from controller.over.law import RATE_HZ, CompanionLaw, Setpoint, design
from controller.over.load_source import LoadSource
from controller.over.stack import Stack, full_thrust, thrust_setpoint
from controller.over.telemetry import Telemetry
from sitl_bridge.frames import flu_to_frd
from sitl_bridge.mavlink.framing import Packer, split
from sitl_bridge.vehicle.description import Vehicle


class State(Enum):
    """Where a flight is; each names what it waits for."""

    CONNECTING = "the stack's HEARTBEAT"
    PREPARING = "the stack's position and attitude"
    ARMING = "the stack to arm"
    TAKING_OFF = "the height, and the load to hang still"
    STREAMING = "a second of set-points"
    TAKING_OVER = "the stack to accept offboard"
    FLYING = "the end of the reference"
    HANDING_BACK = "the stack to hold"
    LANDING = "the stack to land and disarm"
    DONE = "nothing: it is over"
    FAILED = "nothing: it has failed"


HEARTBEAT_INTERVAL = 0.5
RETRY_INTERVAL = 1.0
"""s between two commands of a kind."""
LONGEST_STATE_AGE = 0.2
"""s; older, and nothing is sent."""
LARGEST_TILT = math.radians(60.0)
LARGEST_SPEED = 15.0
STREAM_TIME = 1.2
"""s of set-points before offboard is asked for."""
HEIGHT_TOLERANCE = 0.4
"""m"""
STILL_TIME = 3.0
"""s at the height before the take-over."""
PATIENCE = {State.ARMING: 60.0, State.TAKING_OFF: 90.0, State.TAKING_OVER: 10.0, State.HANDING_BACK: 10.0}
"""s in a state after which the flight has failed."""
RATES_ONLY = mavlink.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
STREAMS = (
    (mavlink.MAVLINK_MSG_ID_ODOMETRY, RATE_HZ),
    (mavlink.MAVLINK_MSG_ID_HIGHRES_IMU, RATE_HZ),
    (mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, RATE_HZ),
    (mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 50.0),
    (mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 5.0),
    (mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 2.0),
    (mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN, 1.0),
)
OUR_SYSTEM = 200


class Companion:
    """One flight over a stack."""

    def __init__(
        self,
        vehicle: Vehicle,
        stack: Stack,
        source: LoadSource,
        path_from: PathFrom,
        duration_s: float,
        say: Callable[[str], None],
        record: Callable[[float, Array, Array], None] = lambda time_s, state, reference: None,
    ) -> None:
        """duration_s: of the reference; record: called at each step with its time, state and reference."""
        self.state = State.CONNECTING
        self.failure: str | None = None
        self.telemetry = Telemetry()
        self.steps = 0
        self.began_at: float | None = None
        """When the take-over was accepted, s of `now`."""
        self._vehicle, self._stack = vehicle, stack
        self._dialect = DIALECTS[stack.kind]
        self._source, self._path_from, self._duration = source, path_from, duration_s
        self._say, self._record = say, record
        self._design = design(vehicle, stack)
        self._full = full_thrust(vehicle, stack)
        self._law: CompanionLaw | None = None
        self._packer = Packer(OUR_SYSTEM, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)
        self._next_heartbeat = self._next_try = 0.0
        self._since = 0.0
        self._still_since: float | None = None
        self._begin_time: float | None = None
        self._out: list[bytes] = []

    # The protocol.

    def next_deadline(self) -> float:
        """When `to_send` has something at the latest."""
        return min(self._next_heartbeat, self._next_try)

    def receive(self, datagram: bytes, now: float) -> None:
        """Take in what a link brings."""
        for frame in split(datagram).frames:
            self.telemetry.take(frame, now)
            self._source.hear(frame, now)

    def to_send(self, now: float) -> list[bytes]:
        """What is due: HEARTBEAT, commands, and a set-point for each new state of the stack."""
        if now >= self._next_heartbeat:
            self._next_heartbeat = now + HEARTBEAT_INTERVAL
            self._pack(
                mavlink.MAVLink_heartbeat_message(
                    mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3
                )
            )
            self._pack(mavlink.MAVLink_timesync_message(0, round(now * 1e9)))
        while self.telemetry.texts:
            self._say(f"the stack says: {self.telemetry.texts.popleft()}")
        _STEPS[self.state](self, now)
        patience = PATIENCE.get(self.state)
        if patience is not None and now - self._since > patience:
            self._fail(f"waited {patience:g} s for {self.state.value}", now)
        out, self._out = self._out, []
        return out

    # The states.

    def _connecting(self, now: float) -> None:
        if self.telemetry.system is not None:
            self._say(f"{self._dialect.name} is there (system {self.telemetry.system})")
            self._go(State.PREPARING, now)

    def _preparing(self, now: float) -> None:
        if self._due(now):
            for message_id, rate in STREAMS:
                self._pack(dialects.message_interval(self._system, message_id, rate))
            if self._dialect.thrust_parameter is not None:
                self._pack(
                    mavlink.MAVLink_param_request_read_message(
                        self._system, 1, self._dialect.thrust_parameter.encode(), -1
                    )
                )
        t = self.telemetry
        if t.vehicle is None or t.altitude_msl is None or t.home_altitude is None:
            return
        flying = t.armed and t.landed == mavlink.MAV_LANDED_STATE_IN_AIR
        self._go(State.STREAMING if flying else State.ARMING, now)

    def _arming(self, now: float) -> None:
        self._note_acks("arming")
        if self.telemetry.armed:
            self._go(State.TAKING_OFF, now)
        elif self._due(now):
            mode = self._dialect.takeoff_mode
            if mode is not None and self.telemetry.custom_mode != mode.custom:
                self._pack(dialects.set_mode(self._system, mode))
            self._pack(dialects.arm(self._system))

    def _taking_off(self, now: float) -> None:
        self._note_acks("take-off")
        t = self.telemetry
        height = self._vehicle.hover_length + 2.5
        assert t.home_altitude is not None
        assert t.altitude_msl is not None
        above_home = t.altitude_msl - t.home_altitude
        if self._due(now) and above_home < 0.5:
            altitude = height if self._dialect.relative_takeoff else t.home_altitude + height
            self._pack(dialects.take_off(self._system, altitude))
        there = abs(above_home - height) < HEIGHT_TOLERANCE
        self._source.state(t, now)
        t.fresh = False
        if not there:
            self._still_since = None
        elif self._still_since is None:
            self._still_since = now
        elif now - self._still_since > STILL_TIME:
            self._go(State.STREAMING, now)

    def _streaming(self, now: float) -> None:
        estimate = self._new_state(now)
        if estimate is not None:
            self._send(self._hovering())
            if now - self._since > STREAM_TIME:
                self._go(State.TAKING_OVER, now)

    def _taking_over(self, now: float) -> None:
        self._note_acks("offboard")
        estimate = self._new_state(now)
        if self._due(now):
            self._pack(dialects.set_mode(self._system, self._dialect.offboard))
        if self._in_mode(self._dialect.offboard):
            if estimate is None:
                return
            self._engage(estimate, now)
        elif estimate is not None:
            self._send(self._hovering())

    def _engage(self, estimate: Array, now: float) -> None:
        x, y, z = estimate[LOAD_POSITION].tolist()
        path = planned(self._path_from((x, y, z)), self._vehicle)
        path["start"] = (x, y, z)
        path["yaw"] = estimate[EULER_ANGLES][2]
        self._law = CompanionLaw(self._vehicle, self._stack, self._design, path)
        self.began_at, self._begin_time = now, self._stack_time
        self._say("took over: flying the load")
        self._go(State.FLYING, now)
        self._fly(estimate)

    def _flying(self, now: float) -> None:
        if not self._in_mode(self._dialect.offboard):
            self._fail("the operator, or a failsafe, took another mode: nothing is sent any more", now)
            return
        if now - self.telemetry.vehicle_at > LONGEST_STATE_AGE:
            self._fail(
                f"the stack's state is older than {LONGEST_STATE_AGE} s: nothing is sent any more", now
            )
            return
        estimate = self._new_state(now)
        if estimate is None:
            return
        roll, pitch, _ = estimate[EULER_ANGLES].tolist()
        speed = float(np.linalg.norm(estimate[VEHICLE_VELOCITY]))
        if math.cos(roll) * math.cos(pitch) < math.cos(LARGEST_TILT) or speed > LARGEST_SPEED:
            self._fail("tilt or speed is out of the envelope: nothing is sent any more", now)
            return
        self._fly(estimate)
        assert self._begin_time is not None
        if self._stack_time - self._begin_time >= self._duration:
            self._say("the reference is over: handing back")
            self._go(State.HANDING_BACK, now)

    def _fly(self, estimate: Array) -> None:
        assert self._law is not None
        assert self._begin_time is not None
        time_s = self._stack_time - self._begin_time
        self._send(self._law.step(estimate, time_s))
        self.steps += 1
        self._record(time_s, estimate, self._law.reference)

    def _handing_back(self, now: float) -> None:
        """The law goes on until the stack holds: there is no gap between the two."""
        estimate = self._new_state(now)
        if self._in_mode(self._dialect.hold):
            self._go(State.LANDING, now)
            return
        if self._due(now):
            self._pack(dialects.set_mode(self._system, self._dialect.hold))
        if estimate is not None:
            self._fly(estimate)

    def _landing(self, now: float) -> None:
        if not self.telemetry.armed:
            self._say("landed and disarmed")
            self._go(State.DONE, now)
        elif self._due(now) and not self._in_mode(self._dialect.land):
            self._pack(dialects.set_mode(self._system, self._dialect.land))

    def _over(self, now: float) -> None:
        """Nothing more."""

    # Small things.

    @property
    def _system(self) -> int:
        assert self.telemetry.system is not None
        return self.telemetry.system

    @property
    def _stack_time(self) -> float:
        assert self.telemetry.vehicle is not None
        return self.telemetry.vehicle.time_s

    def _new_state(self, now: float) -> Array | None:
        """The law's state, once for each new state of the stack."""
        if not self.telemetry.fresh:
            return None
        self.telemetry.fresh = False
        return self._source.state(self.telemetry, now)

    def _hovering(self) -> Setpoint:
        """What is streamed before the take-over: without effect then, and harmless."""
        return Setpoint(self._vehicle.hover_thrust, (0.0, 0.0, 0.0))

    def _send(self, wanted: Setpoint) -> None:
        curve = self._stack.thrust_curve
        if curve is None:
            curve = self.telemetry.parameters.get(self._dialect.thrust_parameter or "", 0.0)
        thrust = thrust_setpoint(wanted.thrust, self._full, curve)
        milliseconds = round(self._stack_time * 1e3) & 0xFFFFFFFF
        self._pack(
            mavlink.MAVLink_set_attitude_target_message(
                milliseconds,
                self._system,
                1,
                RATES_ONLY,
                [1.0, 0.0, 0.0, 0.0],
                *flu_to_frd(wanted.rates),
                thrust,
            )
        )

    def _in_mode(self, numbers: ModeNumbers) -> bool:
        return self.telemetry.custom_mode == numbers.custom

    def _note_acks(self, what: str) -> None:
        while self.telemetry.acks:
            command, result = self.telemetry.acks.popleft()
            if result not in (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS):
                if command in (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,):
                    continue
                name = mavlink.enums["MAV_RESULT"][result].name.removeprefix("MAV_RESULT_").lower()
                self._say(f"{what}: command {command} was {name}")

    def _due(self, now: float) -> bool:
        if now < self._next_try:
            return False
        self._next_try = now + RETRY_INTERVAL
        return True

    def _pack(self, message: Any) -> None:
        self._out.append(self._packer.pack(message))

    def _go(self, state: State, now: float) -> None:
        self.state, self._since, self._next_try = state, now, now

    def _fail(self, why: str, now: float) -> None:
        self.failure = why
        self._say(why)
        self._go(State.FAILED, now)


_STEPS: dict[State, Callable[[Companion, float], None]] = {
    State.CONNECTING: Companion._connecting,
    State.PREPARING: Companion._preparing,
    State.ARMING: Companion._arming,
    State.TAKING_OFF: Companion._taking_off,
    State.STREAMING: Companion._streaming,
    State.TAKING_OVER: Companion._taking_over,
    State.FLYING: Companion._flying,
    State.HANDING_BACK: Companion._handing_back,
    State.LANDING: Companion._landing,
    State.DONE: Companion._over,
    State.FAILED: Companion._over,
}
