"""Mission items: what they mean, and which plans this vehicle can fly."""

from __future__ import annotations

import math
from typing import NamedTuple

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.fence import Fence
from controller.ground.telemetry.vehicle_state import Profile
from sitl_bridge.frames import DEG_E7_PER_DEG, Geodetic, Triple

WAYPOINT: int = mavlink.MAV_CMD_NAV_WAYPOINT
LOITER: int = mavlink.MAV_CMD_NAV_LOITER_UNLIM
LOITER_TIME: int = mavlink.MAV_CMD_NAV_LOITER_TIME
RETURN: int = mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
LAND: int = mavlink.MAV_CMD_NAV_LAND
TAKEOFF: int = mavlink.MAV_CMD_NAV_TAKEOFF
DELAY: int = mavlink.MAV_CMD_NAV_DELAY
JUMP: int = mavlink.MAV_CMD_DO_JUMP
CHANGE_SPEED: int = mavlink.MAV_CMD_DO_CHANGE_SPEED

WITH_POSITION = (WAYPOINT, LOITER, LOITER_TIME, TAKEOFF, LAND)
SUPPORTED = (*WITH_POSITION, RETURN, DELAY, JUMP, CHANGE_SPEED)
AMSL_FRAMES = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
RELATIVE_FRAMES = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
MOST_ITEMS = 500


class Item(NamedTuple):
    """One mission item as the wire has it (x, y in degrees times 1e7 where they are a position)."""

    frame: int
    command: int
    autocontinue: int
    p1: float
    p2: float
    p3: float
    p4: float
    x: int
    y: int
    z: float

    @property
    def has_place(self) -> bool:
        """Whether x and y name a place: take-off and landing may leave it to where the vehicle is."""
        return self.command in WITH_POSITION and not (
            self.command in (TAKEOFF, LAND) and (self.x, self.y) == (0, 0)
        )


class Fault(NamedTuple):
    """Why a plan cannot be flown."""

    result: int
    """MAV_MISSION_RESULT"""
    text: str


def place(item: Item, profile: Profile, home: Geodetic) -> Triple:
    """Where an item with a position is, m ENU."""
    altitude = item.z if item.frame in AMSL_FRAMES else home.altitude + item.z
    latitude, longitude = item.x / DEG_E7_PER_DEG, item.y / DEG_E7_PER_DEG
    return profile.origin.local(Geodetic(latitude, longitude, altitude))


def check(items: tuple[Item, ...], profile: Profile, home: Geodetic, fence: Fence) -> Fault | None:
    """The first fault of a plan, None if it can be flown."""
    for index, item in enumerate(items):
        fault = _check_item(item, len(items), profile, home, fence)
        if fault is not None:
            return Fault(fault.result, f"Mission item {index}: {fault.text}")
    return None


def too_low(items: tuple[Item, ...], profile: Profile, home: Geodetic, fence: Fence) -> list[int]:
    """Items whose altitude the hanging load forbids; they are flown as low as it allows."""
    return [
        index
        for index, item in enumerate(items)
        if item.command in WITH_POSITION
        and item.command not in (LAND, TAKEOFF)
        and fence.too_low(place(item, profile, home))
    ]


def _check_item(item: Item, count: int, profile: Profile, home: Geodetic, fence: Fence) -> Fault | None:
    numbers = (item.p1, item.p2, item.p3, item.p4)
    for place_of, number in enumerate(numbers):
        if math.isinf(number):
            return Fault(mavlink.MAV_MISSION_INVALID_PARAM1 + place_of, f"param{place_of + 1} is infinite")
    if item.command not in SUPPORTED:
        return Fault(mavlink.MAV_MISSION_UNSUPPORTED, f"command {item.command} is not supported; remove it")
    if item.command in WITH_POSITION:
        return _check_place(item, profile, home, fence)
    if item.command == JUMP and not (0 <= item.p1 < count and item.p1 == int(item.p1)):
        return Fault(mavlink.MAV_MISSION_INVALID_PARAM1, f"jump to item {item.p1:g} of {count}")
    if item.command == JUMP and not (math.isfinite(item.p2) and item.p2 == int(item.p2) and item.p2 >= -1):
        return Fault(
            mavlink.MAV_MISSION_INVALID_PARAM2, f"{item.p2:g} repetitions; use -1 (for ever) or more"
        )
    if item.command == CHANGE_SPEED and not (item.p2 > 0 or item.p2 == -1 or math.isnan(item.p2)):
        return Fault(
            mavlink.MAV_MISSION_INVALID_PARAM2, f"speed {item.p2:g} m/s; use more than 0, or -1 for no change"
        )
    if item.command == DELAY and not (item.p1 >= 0):
        return Fault(
            mavlink.MAV_MISSION_INVALID_PARAM1, "delay until a time of day is not supported; use seconds"
        )
    return None


def _check_place(item: Item, profile: Profile, home: Geodetic, fence: Fence) -> Fault | None:
    if item.frame not in AMSL_FRAMES and item.frame not in RELATIVE_FRAMES:
        return Fault(
            mavlink.MAV_MISSION_UNSUPPORTED_FRAME, f"frame {item.frame} is not supported; use 0, 3, 5 or 6"
        )
    if not math.isfinite(item.z):
        return Fault(mavlink.MAV_MISSION_INVALID_PARAM7, "no altitude")
    if abs(item.x) > 90 * DEG_E7_PER_DEG:
        return Fault(mavlink.MAV_MISSION_INVALID_PARAM5_X, f"latitude {item.x / DEG_E7_PER_DEG:.4f}")
    if abs(item.y) > 180 * DEG_E7_PER_DEG:
        return Fault(mavlink.MAV_MISSION_INVALID_PARAM6_Y, f"longitude {item.y / DEG_E7_PER_DEG:.4f}")
    if item.command == LAND and not profile.has_ground:
        return Fault(mavlink.MAV_MISSION_UNSUPPORTED, "there is no ground to land on")
    point = place(item, profile, home)
    if not item.has_place:  # above home, as far as the fence can tell before the flight
        point = (fence.home[0], fence.home[1], point[2])
    fault = fence.outside(point)
    return Fault(mavlink.MAV_MISSION_DENIED, fault) if fault else None
