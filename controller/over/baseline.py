"""For comparison: the stack's own position control flies the vehicle to where it belongs above the load.

It gets the raw set-point, or the motion that the law's feed-forward would fly: position, velocity and
acceleration of the vehicle. The law is not in the loop.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from pymavlink.dialects.v20 import common as mavlink

from controller.law.state import VEHICLE_POSITION, VEHICLE_VELOCITY, Array
from controller.over.law import CompanionLaw
from sitl_bridge.frames import Triple, enu_to_ned

_M = mavlink
_NO_VELOCITY = (
    _M.POSITION_TARGET_TYPEMASK_VX_IGNORE
    | _M.POSITION_TARGET_TYPEMASK_VY_IGNORE
    | _M.POSITION_TARGET_TYPEMASK_VZ_IGNORE
)
_NO_ACCELERATION = (
    _M.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | _M.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | _M.POSITION_TARGET_TYPEMASK_AZ_IGNORE
)
MOTION_MASK = _M.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
POINT_MASK = MOTION_MASK | _NO_VELOCITY | _NO_ACCELERATION
SPACING = 0.02
"""s, of the difference that gives the acceleration."""


class Baseline(StrEnum):
    """What the stack's position control is given."""

    POINT = "point"
    """The raw set-point."""
    MOTION = "motion"
    """The smooth motion."""


class Target(NamedTuple):
    """Of the vehicle, in the frame of the state, each (3,): m, m/s, m/s²; None: not given."""

    position: Array
    velocity: Array | None = None
    acceleration: Array | None = None


def target(baseline: Baseline, law: CompanionLaw, length: float, time_s: float) -> Target:
    """Where the vehicle is to be at a time of the law's path; length: of the cable in hover, m."""
    if baseline is Baseline.POINT:
        return Target(law.raw(time_s) + np.array((0.0, 0.0, length)))
    now = law.desired(time_s)
    before, after = (law.desired(time_s + away)[VEHICLE_VELOCITY] for away in (-SPACING, SPACING))
    return Target(now[VEHICLE_POSITION], now[VEHICLE_VELOCITY], (after - before) / (2.0 * SPACING))


def message(
    wanted: Target, offset: Triple, yaw: float, milliseconds: int, system: int
) -> mavlink.MAVLink_set_position_target_local_ned_message:
    """SET_POSITION_TARGET_LOCAL_NED; offset: of the state's frame in the stack's, m ENU; yaw: ENU, rad."""
    zero = np.zeros(3)
    moving = wanted.velocity is not None
    return mavlink.MAVLink_set_position_target_local_ned_message(
        milliseconds,
        system,
        1,
        mavlink.MAV_FRAME_LOCAL_NED,
        MOTION_MASK if moving else POINT_MASK,
        *_ned(wanted.position + np.array(offset)),
        *_ned(zero if wanted.velocity is None else wanted.velocity),
        *_ned(zero if wanted.acceleration is None else wanted.acceleration),
        math.remainder(0.5 * math.pi - yaw, 2.0 * math.pi),
        0.0,
    )


def _ned(vector: Array) -> Triple:
    east, north, up = vector.tolist()
    return enu_to_ned((east, north, up))
