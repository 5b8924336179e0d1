"""Offboard set-points: from SET_POSITION_TARGET_* or SET_ATTITUDE_TARGET to one value, masks respected."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.motion.setpoint_types import Attitude
from controller.ground.telemetry.vehicle_state import Profile, VehicleView
from sitl_bridge.frames import (
    DEG_E7_PER_DEG,
    Geodetic,
    Triple,
    attitude_to_ned_frd,
    enu_to_ned,
    euler_from_quaternion,
    flu_to_frd,
    yaw_from_heading,
)

NOTHING: Triple = (math.nan, math.nan, math.nan)
_POSITION, _VELOCITY, _ACCELERATION = 0, 3, 6
_LARGEST_RATE = 100.0
"""rad/s"""
_FORCE, _NO_YAW, _NO_YAW_RATE = 1 << 9, 1 << 10, 1 << 11
_BODY_FRAMES = (mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED, mavlink.MAV_FRAME_BODY_FRD)
OFFSET_FRAMES = (mavlink.MAV_FRAME_LOCAL_OFFSET_NED, *_BODY_FRAMES)
_AMSL_FRAMES = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
_RELATIVE_FRAMES = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)


class Setpoint(NamedTuple):
    """What an offboard client asks for: world ENU, SI, yaw anticlockwise from east; NaN where masked."""

    of_load: bool
    """Of the load; else of the vehicle."""
    position: Triple
    velocity: Triple
    acceleration: Triple
    yaw: float
    yaw_rate: float


class Anchor(NamedTuple):
    """What positions of offset and body frames count from."""

    position: Triple
    """m ENU, of the body that is steered"""
    yaw: float
    """rad ENU"""


def setpoint_of(
    message: Any, of_load: bool, profile: Profile, home: Triple, anchor: Anchor, view: VehicleView
) -> Setpoint | str:
    """The set-point of SET_POSITION_TARGET_LOCAL_NED or _GLOBAL_INT, or why it cannot be flown."""
    mask = message.type_mask
    velocity = _unmasked((message.vx, message.vy, message.vz), mask, _VELOCITY)
    acceleration = _unmasked((message.afx, message.afy, message.afz), mask, _ACCELERATION)
    if mask & _FORCE and any(not math.isnan(a) for a in acceleration):
        return "Force set-points are not supported; send acceleration, or mask it"
    if message.id == mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT:
        found = _global_position(message, mask, profile, home)
    else:
        found = _local_position(message, mask, anchor)
    if isinstance(found, str):
        return found
    if (
        message.coordinate_frame in _BODY_FRAMES
        and message.id == mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED
    ):
        velocity, acceleration = (
            _from_heading_frame(v, euler_from_quaternion(view.attitude)[2]) for v in (velocity, acceleration)
        )
    else:
        velocity, acceleration = enu_to_ned(velocity), enu_to_ned(acceleration)
    heading = math.nan if mask & _NO_YAW else message.yaw
    turn = math.nan if mask & _NO_YAW_RATE else message.yaw_rate
    numbers = (*found, *velocity, *acceleration, heading, turn)
    if any(math.isinf(number) or abs(number) > 1e6 for number in numbers):
        return "Set-point with a number beyond all bounds; mask what is not meant"
    if all(math.isnan(number) for number in numbers):
        return "Set-point that asks for nothing; unmask what is meant"
    # As on PX4, what is asked for on some axes only leaves the others where they are.
    x, y, z = (
        0.0 if all(math.isnan(n) for n in axis) else axis[1]
        for axis in zip(found, velocity, acceleration, strict=True)
    )
    velocity = (x, y, z)
    yaw = math.nan if math.isnan(heading) else yaw_from_heading(heading)
    return Setpoint(of_load, found, velocity, acceleration, yaw, -turn)


_NO_THRUST, _NO_ATTITUDE = 1 << 6, 1 << 7


def attitude_setpoint_of(message: Any) -> Attitude | str:
    """The set-point of SET_ATTITUDE_TARGET, or why it cannot be flown."""
    mask = message.type_mask
    if mask & _NO_THRUST or not math.isfinite(message.thrust):
        return "Set-point denied: attitude without thrust; unmask it"
    asked = (message.body_roll_rate, message.body_pitch_rate, message.body_yaw_rate)
    if any(math.isinf(rate) or abs(rate) > _LARGEST_RATE for rate in asked):
        return "Set-point denied: a body rate is beyond all bounds"
    rates = flu_to_frd(_unmasked(asked, mask, 0))
    thrust = min(max(message.thrust, 0.0), 1.0)
    if mask & _NO_ATTITUDE:
        if all(math.isnan(rate) for rate in rates):
            return "Set-point denied: neither attitude nor body rates; unmask one"
        return Attitude(None, rates, thrust)
    w, x, y, z = message.q
    size = math.sqrt(w * w + x * x + y * y + z * z)
    if not 0.5 < size < 2.0:
        return "Set-point denied: q is no attitude; send a unit quaternion"
    return Attitude(attitude_to_ned_frd((w / size, x / size, y / size, z / size)), rates, thrust)


def _unmasked(values: Triple, mask: int, shift: int) -> Triple:
    x, y, z = (math.nan if mask >> shift + i & 1 else value for i, value in enumerate(values))
    return (x, y, z)


def _local_position(message: Any, mask: int, anchor: Anchor) -> Triple | str:
    position = _unmasked((message.x, message.y, message.z), mask, _POSITION)
    frame = message.coordinate_frame
    if frame == mavlink.MAV_FRAME_LOCAL_NED:
        return enu_to_ned(position)
    if frame in _BODY_FRAMES:
        offset = _from_heading_frame(position, anchor.yaw)
    elif frame == mavlink.MAV_FRAME_LOCAL_OFFSET_NED:
        offset = enu_to_ned(position)
    else:
        return f"Set-points in frame {frame} are not supported; use 1 (local), 7 (offset), 8, 9 or 12 (body)"
    x, y, z = (p + d for p, d in zip(anchor.position, offset, strict=True))
    return (x, y, z)


def _global_position(message: Any, mask: int, profile: Profile, home: Triple) -> Triple | str:
    masked = _unmasked((0.0, 0.0, message.alt), mask, _POSITION)
    if message.coordinate_frame in _AMSL_FRAMES:
        altitude = masked[2]
    elif message.coordinate_frame in _RELATIVE_FRAMES:
        altitude = masked[2] + profile.origin.home.altitude + home[2]
    else:
        frame = f"Set-points in frame {message.coordinate_frame}"
        return f"{frame} are not supported; use 0, 5 (AMSL), 3 or 6 (above home)"
    point = Geodetic(message.lat_int / DEG_E7_PER_DEG, message.lon_int / DEG_E7_PER_DEG, altitude)
    north_masked, east_masked = math.isnan(masked[0]), math.isnan(masked[1])
    east, north, up = profile.origin.local(point)
    return (math.nan if east_masked else east, math.nan if north_masked else north, up)


def _from_heading_frame(v: Triple, yaw: float) -> Triple:
    """Forward, right, down by a heading, level: to ENU; NaN beside a number counts as 0."""
    if not (math.isnan(v[0]) and math.isnan(v[1])):
        v = (0.0 if math.isnan(v[0]) else v[0], 0.0 if math.isnan(v[1]) else v[1], v[2])
    c, s = math.cos(yaw), math.sin(yaw)
    return (v[0] * c + v[1] * s, v[0] * s - v[1] * c, -v[2])


class Offboard:
    """The set-point that counts, and whose it is: one sender at a time, until it falls silent."""

    def __init__(self) -> None:
        self.latest: Setpoint | Attitude | None = None
        self._time = -math.inf
        self._sender: object = None
        self._anchor: Anchor | None = None
        self._offset: object = None
        """Of the last message in an offset frame"""

    def offer(self, setpoint: Setpoint | Attitude, sender: object, now: float, timeout: float) -> str:
        """Take a set-point; returns why not, or an empty string."""
        if self.fresh(now, timeout) and sender != self._sender:
            return "Another client has offboard control; stop its set-points first"
        self.latest, self._time, self._sender = setpoint, now, sender
        return ""

    def anchor(self, message: Any, here: Anchor, now: float, timeout: float) -> Anchor:
        """What an offset counts from: where its first message came, for as long as it is repeated."""
        offset = (message.coordinate_frame, message.type_mask, message.x, message.y, message.z)
        if self._anchor is None or offset != self._offset or not self.fresh(now, timeout):
            self._anchor, self._offset = here, offset
        return self._anchor

    def fresh(self, now: float, timeout: float) -> bool:
        """Whether a set-point came within the last `timeout` seconds."""
        return now - self._time <= timeout
