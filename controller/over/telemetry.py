"""What the stack says: the vehicle's state with its age, modes, acknowledgements, parameters, texts.

World ENU about the stack's local origin, body FLU, SI units.
"""

from __future__ import annotations

import math
import statistics
import struct
from collections import deque
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import common as mavlink

from sitl_bridge.frames import (
    DEG_E7_PER_DEG,
    MILLIMETRES_PER_METRE,
    Geodetic,
    LocalOrigin,
    Quaternion,
    Triple,
    attitude_to_enu_flu,
    enu_to_ned,
    flu_to_frd,
    rotate,
)
from sitl_bridge.mavlink.framing import Frame, decode

MOST_TEXTS = 50
_INTEGERS = (mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_UINT32)
TEXT_LENGTH = 50
"""Characters of a STATUSTEXT; a longer text comes in several."""
SAMPLES = 5
"""TIMESYNC answers that have to agree before an age is told from them."""
LARGEST_SPREAD = 0.05
"""s between those: beyond it the stack's clock does not run at the pace of ours."""


class VehicleState(NamedTuple):
    """Of the vehicle, as the stack estimates it."""

    time_s: float
    """By the stack's clock."""
    position: Triple
    velocity: Triple
    """World."""
    attitude: Quaternion
    """FLU to world."""
    rates: Triple
    """rad/s, FLU."""


class ImuSample(NamedTuple):
    """HIGHRES_IMU."""

    time_s: float
    specific_force: Triple
    """m/s², FLU."""


class Ack(NamedTuple):
    """COMMAND_ACK."""

    command: int
    result: int


@dataclass
class ClockOffset:
    """The stack's clock against ours, from TIMESYNC: stack - ours, s."""

    _samples: deque[float] = field(default_factory=lambda: deque(maxlen=SAMPLES))

    def sample(self, sent_s: float, stack_s: float, now: float) -> None:
        """A TIMESYNC that we sent at `sent_s` came back at `now` with the stack's time."""
        self._samples.append(stack_s - 0.5 * (sent_s + now))

    def age(self, stack_s: float, now: float) -> float | None:
        """s since an instant of the stack's clock.

        None: not known yet, or a simulated clock that does not keep pace with ours.
        """
        if len(self._samples) < SAMPLES or max(self._samples) - min(self._samples) > LARGEST_SPREAD:
            return None
        return now - (stack_s - statistics.median(self._samples))


@dataclass
class Telemetry:
    """Everything heard of one stack."""

    system: int | None = None
    """The stack's system; None: no HEARTBEAT of an autopilot yet."""
    autopilot: int = mavlink.MAV_AUTOPILOT_GENERIC
    armed: bool = False
    custom_mode: int | None = None
    heard_at: float = -math.inf
    """When the last HEARTBEAT came, s."""
    vehicle: VehicleState | None = None
    vehicle_at: float = -math.inf
    """When it came, s."""
    landed: int = mavlink.MAV_LANDED_STATE_UNDEFINED
    origin: LocalOrigin | None = None
    """Of the stack's local frame."""
    altitude_msl: float | None = None
    """m, of the vehicle."""
    home_altitude: float | None = None
    """m above the sea."""
    home: Triple | None = None
    """Where it took off, or will, m in the stack's local frame."""
    clock: ClockOffset = field(default_factory=ClockOffset)
    parameters: dict[str, float] = field(default_factory=dict)
    acks: deque[Ack] = field(default_factory=deque)
    """Not taken yet, oldest first."""
    texts: deque[str] = field(default_factory=lambda: deque(maxlen=MOST_TEXTS))
    """STATUSTEXTs that have not been shown yet."""
    said: deque[str] = field(default_factory=lambda: deque(maxlen=MOST_TEXTS))
    """STATUSTEXTs, all of them."""
    imu: deque[ImuSample] = field(default_factory=lambda: deque(maxlen=100))
    """Not taken yet."""
    fresh: bool = False
    """Whether the vehicle's state is newer than the last time somebody cleared this."""
    _attitude: Quaternion | None = None
    _rates: Triple = (0.0, 0.0, 0.0)
    last_imu: ImuSample | None = None
    _has_odometry: bool = False
    _text_parts: dict[int, str] = field(default_factory=dict)
    """Of STATUSTEXTs that come in several frames, by their id."""

    def take(self, frame: Frame, now: float) -> None:
        """Take in one frame; what is not the stack's autopilot's is ignored."""
        handler = _HANDLERS.get(frame.message_id)
        if handler is None or frame.component != mavlink.MAV_COMP_ID_AUTOPILOT1:
            return
        if self.system is not None and frame.system != self.system:
            return
        if self.system is None and frame.message_id != mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            return
        try:
            message = decode(frame)
        except Exception:  # pymavlink raises many kinds of errors for a payload that it can't unpack
            return
        handler(self, frame, message, now)

    def _on_heartbeat(self, frame: Frame, message: Any, now: float) -> None:
        if message.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return
        self.system, self.autopilot = frame.system, message.autopilot
        self.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        self.custom_mode, self.heard_at = message.custom_mode, now

    def _on_odometry(self, frame: Frame, message: Any, now: float) -> None:
        attitude = attitude_to_enu_flu(tuple(message.q))
        velocity = rotate(attitude, flu_to_frd((message.vx, message.vy, message.vz)))
        if message.child_frame_id in (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_FRD):
            velocity = enu_to_ned((message.vx, message.vy, message.vz))
        self._has_odometry = True
        self._set_vehicle(
            VehicleState(
                message.time_usec * 1e-6,
                enu_to_ned((message.x, message.y, message.z)),
                velocity,
                attitude,
                flu_to_frd((message.rollspeed, message.pitchspeed, message.yawspeed)),
            ),
            now,
        )

    def _on_attitude(self, frame: Frame, message: Any, now: float) -> None:
        self._attitude = attitude_to_enu_flu((message.q1, message.q2, message.q3, message.q4))
        self._rates = flu_to_frd((message.rollspeed, message.pitchspeed, message.yawspeed))

    def _on_local_position(self, frame: Frame, message: Any, now: float) -> None:
        if self._has_odometry or self._attitude is None:
            return
        position = enu_to_ned((message.x, message.y, message.z))
        velocity = enu_to_ned((message.vx, message.vy, message.vz))
        time_s = message.time_boot_ms * 1e-3
        self._set_vehicle(VehicleState(time_s, position, velocity, self._attitude, self._rates), now)

    def _set_vehicle(self, state: VehicleState, now: float) -> None:
        numbers = (*state.position, *state.velocity, *state.attitude, *state.rates)
        if all(map(math.isfinite, numbers)):
            self.vehicle, self.vehicle_at, self.fresh = state, now, True

    def _on_imu(self, frame: Frame, message: Any, now: float) -> None:
        force = flu_to_frd((message.xacc, message.yacc, message.zacc))
        if all(map(math.isfinite, force)):
            self.last_imu = ImuSample(message.time_usec * 1e-6, force)
            self.imu.append(self.last_imu)

    def _on_origin(self, frame: Frame, message: Any, now: float) -> None:
        self.origin = LocalOrigin(
            message.latitude / DEG_E7_PER_DEG,
            message.longitude / DEG_E7_PER_DEG,
            message.altitude / MILLIMETRES_PER_METRE,
        )

    def _on_global_position(self, frame: Frame, message: Any, now: float) -> None:
        self.altitude_msl = message.alt / MILLIMETRES_PER_METRE
        self.home_altitude = self.altitude_msl - message.relative_alt / MILLIMETRES_PER_METRE

    def _on_home(self, frame: Frame, message: Any, now: float) -> None:
        place = (message.x, message.y, message.z)
        if all(map(math.isfinite, place)):
            self.home = enu_to_ned(place)

    def local(self, point: Geodetic) -> Triple | None:
        """A place on Earth in the stack's local frame; None while its origin is not known."""
        return None if self.origin is None else self.origin.local(point)

    def _on_landed(self, frame: Frame, message: Any, now: float) -> None:
        self.landed = message.landed_state

    def _on_ack(self, frame: Frame, message: Any, now: float) -> None:
        self.acks.append(Ack(message.command, message.result))

    def _on_parameter(self, frame: Frame, message: Any, now: float) -> None:
        value = message.param_value
        if self.autopilot == mavlink.MAV_AUTOPILOT_PX4 and message.param_type in _INTEGERS:
            [value] = struct.unpack("<i", frame.payload[:4].ljust(4, b"\0"))  # bytes, not a number
        self.parameters[message.param_id.rstrip("\0")] = float(value)

    def _on_text(self, frame: Frame, message: Any, now: float) -> None:
        part = message.text.rstrip("\0")
        text = self._text_parts.pop(message.id, "") + part if message.chunk_seq else part
        if message.id and len(part) == TEXT_LENGTH:  # there is more to come
            self._text_parts = {message.id: text}
            return
        self.texts.append(text)
        self.said.append(text)

    def _on_timesync(self, frame: Frame, message: Any, now: float) -> None:
        if message.tc1 > 0:
            self.clock.sample(message.ts1 * 1e-9, message.tc1 * 1e-9, now)


_HANDLERS = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: Telemetry._on_heartbeat,
    mavlink.MAVLINK_MSG_ID_ODOMETRY: Telemetry._on_odometry,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: Telemetry._on_attitude,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: Telemetry._on_local_position,
    mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: Telemetry._on_imu,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: Telemetry._on_origin,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: Telemetry._on_global_position,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: Telemetry._on_home,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: Telemetry._on_landed,
    mavlink.MAVLINK_MSG_ID_COMMAND_ACK: Telemetry._on_ack,
    mavlink.MAVLINK_MSG_ID_PARAM_VALUE: Telemetry._on_parameter,
    mavlink.MAVLINK_MSG_ID_STATUSTEXT: Telemetry._on_text,
    mavlink.MAVLINK_MSG_ID_TIMESYNC: Telemetry._on_timesync,
}
