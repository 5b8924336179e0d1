"""Mission items: what they mean, and which plans this vehicle can fly."""

from __future__ import annotations

import math
from typing import NamedTuple

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.limits.fence import Fence
from controller.ground.flight.payload.payload import winch_fault
from controller.ground.missions.item_types import (
    CHANGE_SPEED,
    DELAYS,
    GRIPPER,
    JUMP,
    LAND,
    LOITER_TIME,
    PAYLOAD_PLACE,
    RETURN,
    ROI,
    SET_HOME,
    SUPPORTED,
    TAKEOFF,
    WAYPOINT,
    WINCH,
    WITH_PLACE,
    WITH_POSITION,
    WITHOUT_EFFECT,
)
from controller.ground.telemetry.vehicle_state import Profile
from sitl_bridge.frames import DEG_E7_PER_DEG, Geodetic, LocalOrigin, Triple

AMSL_FRAMES = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
RELATIVE_FRAMES = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
MOST_ITEMS = 500
LARGEST_SPEED = 100.0
"""m/s, that a plan may ask for; the vehicle flies MPC_XY_VEL_MAX at most"""
_LOCATION = 3
"""DO_SET_ROI's param1 for a place; 0 is none, 1 the next way-point, 2 a way-point, 4 a target"""


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
        """Whether x and y name a place for the vehicle: some items may leave it to where the vehicle is."""
        return self.command in WITH_POSITION and not (
            self.command in (TAKEOFF, LAND, PAYLOAD_PLACE) and (self.x, self.y) == (0, 0)
        )

    @property
    def names_place(self) -> bool:
        """Whether x, y and z are a place of any meaning."""
        if self.command in ROI:
            return self.p1 == _LOCATION
        if self.command == SET_HOME:
            return self.p1 != 1
        return self.command in WITH_PLACE

    @property
    def takes_time(self) -> bool:
        """Whether the plan stays at the item until something has been flown or waited for."""
        return (
            self.command in WITH_POSITION
            or self.command == RETURN
            or (self.command in DELAYS and self.p1 > 0)
        )


class Fault(NamedTuple):
    """Why a plan cannot be flown."""

    result: int
    """MAV_MISSION_RESULT"""
    text: str


def place(item: Item, origin: LocalOrigin, home: Geodetic) -> Triple:
    """Where an item with a position is, m ENU from the origin."""
    altitude = item.z if item.frame in AMSL_FRAMES else home.altitude + item.z
    latitude, longitude = item.x / DEG_E7_PER_DEG, item.y / DEG_E7_PER_DEG
    return origin.local(Geodetic(latitude, longitude, altitude))


def check(items: tuple[Item, ...], profile: Profile, home: Geodetic, fence: Fence) -> Fault | None:
    """The first fault of a plan, None if it can be flown."""
    for index, item in enumerate(items):
        fault = _check_numbers(item, len(items)) or _check_place(item, profile, home, fence)
        if fault is not None:
            return Fault(fault.result, f"Mission item {index}: {fault.text}")
    looping = _endless_jump(items)
    if looping is not None:
        text = f"Mission item {looping}: the jumps form an endless loop without anything to fly"
        return Fault(mavlink.MAV_MISSION_INVALID_PARAM1, text)
    return None


def remarks(items: tuple[Item, ...], profile: Profile, home: Geodetic, fence: Fence) -> list[str]:
    """What a plan that is accepted asks for in vain."""
    idle: dict[str, list[str]] = {}
    low = []
    for index, item in enumerate(items):
        works = _works(item, profile)
        if item.command in WITHOUT_EFFECT and not works:
            idle.setdefault(WITHOUT_EFFECT[item.command], []).append(str(index))
        elif item.command == PAYLOAD_PLACE and not works:
            idle.setdefault("gripper" if profile.gripper is None else "winch", []).append(str(index))
        if item.has_place and item.command not in (LAND, TAKEOFF):
            low += [str(index)] if fence.too_low(place(item, profile.origin, home)) else []
    texts = [
        f"No {what} on this vehicle: no effect of mission items {_listed(where)}"
        for what, where in idle.items()
    ]
    if low:
        least = f"{fence.least_height:.1f} m above home (LND_CLEARANCE)"
        texts.append(f"Mission items too low for the load are flown at {least}: {_listed(low)}")
    return texts


def _works(item: Item, profile: Profile) -> bool:
    """Whether the vehicle has the gripper or winch that an item works."""
    if item.command == PAYLOAD_PLACE:
        return profile.gripper is not None and profile.winch is not None
    fitted = profile.gripper if item.command == GRIPPER else profile.winch
    return item.command in (GRIPPER, WINCH) and fitted is not None


def _listed(indices: list[str]) -> str:
    return ", ".join(indices[:8]) + (", ..." if len(indices) > 8 else "")


def _check_numbers(item: Item, count: int) -> Fault | None:
    """Command and parameters that are no place."""
    if item.command not in SUPPORTED:
        return Fault(mavlink.MAV_MISSION_UNSUPPORTED, f"command {item.command} is not supported; remove it")
    if item.command == WINCH and (fault := winch_fault(item.p2, item.p3, item.p4)):
        return Fault(mavlink.MAV_MISSION_INVALID_PARAM2, f"winch: {fault}")
    if item.command in WITHOUT_EFFECT:
        return None
    first, second = mavlink.MAV_MISSION_INVALID_PARAM1, mavlink.MAV_MISSION_INVALID_PARAM2
    for index, number in enumerate((item.p1, item.p2, item.p3, item.p4)):
        if math.isinf(number):
            return Fault(first + index, f"param{index + 1} is infinite")
    p1, p2 = item.p1, item.p2
    if item.command in (WAYPOINT, LOITER_TIME) and p1 < 0:
        return Fault(first, f"wait of {p1:g} s; use 0 or more")
    if item.command == WAYPOINT and p2 < 0:
        return Fault(second, f"acceptance radius of {p2:g} m; use 0 or more")
    if item.command == JUMP and not (0 <= p1 < count and p1 == int(p1)):
        return Fault(first, f"jump to item {p1:g} of {count}")
    if item.command == JUMP and not (math.isfinite(p2) and p2 == int(p2) and p2 >= -1):
        return Fault(second, f"{p2:g} repetitions; use -1 (for ever) or more")
    if item.command == CHANGE_SPEED and not (p1 in (0, 1) or math.isnan(p1)):
        return Fault(first, f"speed of kind {p1:g} cannot be set; use 0 or 1 (horizontal)")
    if item.command == CHANGE_SPEED and not (0 < p2 <= LARGEST_SPEED or p2 == -1 or math.isnan(p2)):
        return Fault(second, f"speed {p2:g} m/s; use 0 to {LARGEST_SPEED:g}, or -1 for no change")
    if item.command in DELAYS and not p1 >= 0:
        return Fault(first, "delay until a time of day is not supported; use seconds")
    if item.command in ROI and p1 not in (0, 1, 2, _LOCATION, 4):
        return Fault(first, f"region of interest of kind {p1:g}; use 0 to 4")
    if item.command in ROI and p1 == 2 and not (0 <= p2 < count and p2 == int(p2)):
        return Fault(second, f"region of interest at item {p2:g} of {count}")
    return None


def _endless_jump(items: tuple[Item, ...]) -> int | None:
    """A jump of a loop in which nothing takes time, None without one."""
    for start, item in enumerate(items):
        if item.command != JUMP or item.p2 == 0:
            continue
        seen: set[int] = set()
        ahead = [int(item.p1)]
        while ahead:
            index = ahead.pop()
            if index == start:
                return start
            if index in seen or index >= len(items) or items[index].takes_time:
                continue
            seen.add(index)
            jumps = items[index].command == JUMP and items[index].p2 != 0
            ahead += [int(items[index].p1)] if jumps else []
            ahead += [] if jumps and items[index].p2 == -1 else [index + 1]
    return None


def _check_place(item: Item, profile: Profile, home: Geodetic, fence: Fence) -> Fault | None:
    if not item.names_place:
        return None
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
    if item.command not in WITH_POSITION:
        return None
    point = place(item, profile.origin, home)
    if not item.has_place:  # above home, as far as the fence can tell before the flight
        point = (fence.home[0], fence.home[1], point[2])
    fault = fence.outside(point)
    return Fault(mavlink.MAV_MISSION_DENIED, fault) if fault else None
