"""The load's own MAVLink system beside a stack, as a protocol object without I/O."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.motion.setpoint_types import Body, Follow, Goto
from controller.law.state import LOAD_POSITION, LOAD_VELOCITY, Array
from controller.over.live.reference import LIMITS, LiveReference
from sitl_bridge.frames import (
    CENTIMETRES_PER_METRE,
    DEG_E7_PER_DEG,
    MILLIMETRES_PER_METRE,
    Geodetic,
    LocalOrigin,
    Triple,
    enu_to_ned,
    yaw_from_heading,
)
from sitl_bridge.ids import COMPONENT_LOAD, load_system
from sitl_bridge.mavlink.framing import Frame, Packer, decode, split

HEARTBEAT_INTERVAL, POSITION_INTERVAL = 1.0, 0.1
FARTHEST = 1000.0
"""m from where the load is: farther away somebody has mistaken frames or units."""
_POSITION, _VELOCITY, _ACCELERATION, _YAW, _YAW_RATE = 0b111, 0b111000, 0b111000000, 1 << 10, 1 << 11
_OFFSET = mavlink.MAV_FRAME_LOCAL_OFFSET_NED
_RELATIVE = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
_ABSOLUTE = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)


class LoadSystem:
    """Takes points for the load, and shows where it is. Frame of the state: ENU about `origin`."""

    def __init__(self, instance: int, reference: LiveReference, say: Callable[[str], None]) -> None:
        """instance: N of the load's system 101+N; say: told what is asked for, and refused."""
        self.system = load_system(instance)
        self._reference, self._say = reference, say
        self._packer = Packer(self.system, COMPONENT_LOAD)
        self._out: list[bytes] = []
        self._next_heartbeat = self._next_position = 0.0
        self._state: Array | None = None
        self._time_s = 0.0
        self.origin: LocalOrigin | None = None
        """Of the state's frame; None: not known, then only local points are taken."""
        self.home_altitude: float | None = None
        """m above the sea, from which relative altitudes count."""

    def show(self, state: Array, time_s: float) -> None:
        """The law's state (18,), and the stack's time of it, s."""
        self._state, self._time_s = state, time_s

    def receive(self, datagram: bytes) -> None:
        """Take in what a client sends."""
        for frame in split(datagram).frames:
            try:
                message = decode(frame)
            except Exception:  # pymavlink raises many kinds of errors for a payload that it can't unpack
                continue
            if getattr(message, "target_system", None) == self.system:
                self._take(frame, message)

    def to_send(self, now: float) -> list[bytes]:
        """What is due, for every client."""
        if now >= self._next_heartbeat:
            self._next_heartbeat = now + HEARTBEAT_INTERVAL
            self._pack(
                mavlink.MAVLink_heartbeat_message(
                    mavlink.MAV_TYPE_AIRSHIP,
                    mavlink.MAV_AUTOPILOT_INVALID,
                    0,
                    0,
                    mavlink.MAV_STATE_ACTIVE,
                    3,
                )
            )
        if now >= self._next_position and self._state is not None:
            self._next_position = now + POSITION_INTERVAL
            self._show_position(self._state)
        out, self._out = self._out, []
        return out

    def _show_position(self, state: Array) -> None:
        milliseconds = round(self._time_s * 1e3) & 0xFFFFFFFF
        position, velocity = _triple(state[LOAD_POSITION]), _triple(state[LOAD_VELOCITY])
        ned = (*enu_to_ned(position), *enu_to_ned(velocity))
        self._pack(mavlink.MAVLink_local_position_ned_message(milliseconds, *ned))
        if self.origin is None:
            return
        point = self.origin.geodetic(position)
        above = 0.0 if self.home_altitude is None else point.altitude - self.home_altitude
        self._pack(
            mavlink.MAVLink_global_position_int_message(
                milliseconds,
                round(point.latitude * DEG_E7_PER_DEG),
                round(point.longitude * DEG_E7_PER_DEG),
                round(point.altitude * MILLIMETRES_PER_METRE),
                round(above * MILLIMETRES_PER_METRE),
                *(round(v * CENTIMETRES_PER_METRE) for v in ned[3:]),
                0xFFFF,
            )
        )

    # What clients ask for.

    def _take(self, frame: Frame, message: Any) -> None:
        kind = message.get_type()
        if kind == "SET_POSITION_TARGET_LOCAL_NED":
            found = self._local(message)
            if isinstance(found, str):
                self._refuse(f"Set-point denied: {found}")
            else:
                self._reference.go_to(found)
        elif kind in ("COMMAND_INT", "COMMAND_LONG"):
            self._command(frame, message)

    def _command(self, frame: Frame, message: Any) -> None:
        result = mavlink.MAV_RESULT_UNSUPPORTED
        if message.command == mavlink.MAV_CMD_DO_REPOSITION:
            found = self._reposition(message)
            if isinstance(found, str):
                self._refuse(f"Reposition denied: {found}")
                result = mavlink.MAV_RESULT_DENIED
            else:
                self._reference.go_to(found)
                east, north, up = found.position
                self._say(f"the load goes to east {east:.2f}, north {north:.2f}, up {up:.2f} m")
                result = mavlink.MAV_RESULT_ACCEPTED
        self._pack(
            mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, frame.system, frame.component)
        )

    def _here(self) -> Triple | str:
        if self._state is None or not self._reference.flying:
            return "the law does not fly yet"
        return _triple(self._state[LOAD_POSITION])

    def _local(self, message: Any) -> Follow | str:
        here = self._here()
        if isinstance(here, str):
            return here
        if message.coordinate_frame not in (mavlink.MAV_FRAME_LOCAL_NED, _OFFSET):
            return f"frame {message.coordinate_frame}; expected LOCAL_NED or LOCAL_OFFSET_NED"
        mask = message.type_mask
        position, velocity, acceleration = (
            enu_to_ned(_unmasked(values, mask, bits))
            for values, bits in (
                ((message.x, message.y, message.z), _POSITION),
                ((message.vx, message.vy, message.vz), _VELOCITY),
                ((message.afx, message.afy, message.afz), _ACCELERATION),
            )
        )
        if message.coordinate_frame == _OFFSET:
            x, y, z = (a + b for a, b in zip(here, position, strict=True))
            position = (x, y, z)
        if all(math.isnan(v) for v in (*position, *velocity)):
            return "neither a position nor a velocity; unmask one"
        why = _beyond(position, velocity, acceleration, here)
        if why is not None:
            return why
        yaw = math.nan if mask & _YAW else yaw_from_heading(message.yaw)
        rate = math.nan if mask & _YAW_RATE else -message.yaw_rate
        return Follow(Body.LOAD, position, velocity, acceleration, yaw, rate)

    def _reposition(self, message: Any) -> Goto | str:
        here = self._here()
        if isinstance(here, str):
            return here
        if self.origin is None:
            return "the stack has not said where its origin is"
        whole = message.get_type() == "COMMAND_INT"
        frame = message.frame if whole else mavlink.MAV_FRAME_GLOBAL
        latitude, longitude = (
            (message.x / DEG_E7_PER_DEG, message.y / DEG_E7_PER_DEG)
            if whole
            else (message.param5, message.param6)
        )
        altitude = message.z if whole else message.param7
        if frame in _RELATIVE:
            altitude += math.nan if self.home_altitude is None else self.home_altitude
        elif frame not in _ABSOLUTE:
            return f"frame {frame}; expected a global one"
        if not math.isfinite(latitude + longitude):
            return "no latitude and longitude"
        x, y, z = self.origin.local(Geodetic(latitude, longitude, altitude))
        target = (x, y, here[2] if math.isnan(altitude) else z)
        nothing = (math.nan,) * 3
        why = _beyond(target, nothing, nothing, here)
        if why is not None:
            return why
        speed = message.param1 if message.param1 > 0.0 else LIMITS.speed
        yaw = message.param4 if math.isfinite(message.param4) else math.nan
        return Goto(Body.LOAD, target, yaw if math.isnan(yaw) else yaw_from_heading(yaw), speed)

    def _refuse(self, why: str) -> None:
        self._say(why)
        self._pack(mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_WARNING, why.encode()[:50]))

    def _pack(self, message: Any) -> None:
        self._out.append(self._packer.pack(message))


def _beyond(position: Triple, velocity: Triple, acceleration: Triple, here: Triple) -> str | None:
    """Why nobody flies this; an entry that is not asked for is NaN."""
    if any(math.isinf(v) for v in (*position, *velocity, *acceleration)):
        return "a number without bounds"
    away = math.hypot(*(0.0 if math.isnan(p) else p - h for p, h in zip(position, here, strict=True)))
    if away > FARTHEST:
        return f"{away:.0f} m away, {FARTHEST:g} m at most"
    return None


def _unmasked(values: Triple, mask: int, bits: int) -> Triple:
    """Values with NaN where one of the mask's bits says that it is not meant."""
    lowest = (bits & -bits).bit_length() - 1
    x, y, z = (math.nan if mask >> (lowest + i) & 1 else value for i, value in enumerate(values))
    return (x, y, z)


def _triple(vector: Array) -> Triple:
    x, y, z = vector.tolist()
    return (x, y, z)
