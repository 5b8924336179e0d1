"""Plans of the geofence and of rally points: what their items mean."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.limits.fence_zones import Place, Zone
from controller.ground.missions.mission_plan import AMSL_FRAMES, RELATIVE_FRAMES, Fault, Item
from sitl_bridge.frames import DEG_E7_PER_DEG, Geodetic, LocalOrigin

_POLYGONS = {
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
_CIRCLES = {
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: True,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: False,
}
_RETURN_POINT: int = mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT
_RALLY: int = mavlink.MAV_CMD_NAV_RALLY_POINT


def zones_of(items: tuple[Item, ...], origin: LocalOrigin) -> tuple[Zone, ...] | Fault:
    """The areas of a geofence plan."""
    zones = []
    index = 0
    while index < len(items):
        item = items[index]
        if fault := _place_fault(item, index, "Geofence"):
            return fault
        if item.command in _CIRCLES:
            if not (math.isfinite(item.p1) and item.p1 >= 0):
                text = f"Geofence item {index}: radius {item.p1:g} m; use 0 (no zone) or more"
                return Fault(mavlink.MAV_MISSION_INVALID_PARAM1, text)
            if item.p1 > 0:  # MAVSDK's example sends a circle without a radius where it means none
                zones.append(Zone(_CIRCLES[item.command], (_place(item, origin),), item.p1))
            index += 1
        elif item.command in _POLYGONS:
            corners = items[index : index + int(item.p1)] if 3 <= item.p1 <= len(items) else ()
            whole = item.p1 >= 3 and len(corners) == item.p1
            if not whole or any((i.command, i.p1) != (item.command, item.p1) for i in corners):
                text = f"Geofence item {index}: a polygon of {item.p1:g} corners; send 3 or more, all of them"
                return Fault(mavlink.MAV_MISSION_INVALID_PARAM1, text)
            for other, corner in enumerate(corners, index):
                if fault := _place_fault(corner, other, "Geofence"):
                    return fault
            places = tuple(_place(corner, origin) for corner in corners)
            zones.append(Zone(_POLYGONS[item.command], places, 0.0))
            index += len(corners)
        elif item.command == _RETURN_POINT:
            index += 1
        else:
            return Fault(
                mavlink.MAV_MISSION_UNSUPPORTED, f"Geofence item {index}: command {item.command} is none"
            )
    return tuple(zones)


def rally_points_of(items: tuple[Item, ...], origin: LocalOrigin) -> tuple[Place, ...] | Fault:
    """The places of a rally plan."""
    for index, item in enumerate(items):
        if item.command != _RALLY:
            return Fault(
                mavlink.MAV_MISSION_UNSUPPORTED, f"Rally item {index}: command {item.command} is none"
            )
        if fault := _place_fault(item, index, "Rally"):
            return fault
    return tuple(_place(item, origin) for item in items)


def _place(item: Item, origin: LocalOrigin) -> Place:
    where = Geodetic(item.x / DEG_E7_PER_DEG, item.y / DEG_E7_PER_DEG, origin.home.altitude)
    return origin.local(where)[:2]


def _place_fault(item: Item, index: int, plan: str) -> Fault | None:
    if item.frame not in AMSL_FRAMES and item.frame not in RELATIVE_FRAMES:
        text = f"{plan} item {index}: frame {item.frame} is not supported; use 0, 3, 5 or 6"
        return Fault(mavlink.MAV_MISSION_UNSUPPORTED_FRAME, text)
    if abs(item.x) > 90 * DEG_E7_PER_DEG:
        text = f"{plan} item {index}: latitude {item.x / DEG_E7_PER_DEG:.4f}"
        return Fault(mavlink.MAV_MISSION_INVALID_PARAM5_X, text)
    if abs(item.y) > 180 * DEG_E7_PER_DEG:
        text = f"{plan} item {index}: longitude {item.y / DEG_E7_PER_DEG:.4f}"
        return Fault(mavlink.MAV_MISSION_INVALID_PARAM6_Y, text)
    return None
