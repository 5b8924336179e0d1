"""The load as traffic: ADSB_VEHICLE, the only way in which QGroundControl draws what has no autopilot."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import common

from sitl_bridge.ids import load_system

_FULL_CIRCLE = 36000
"""Centidegrees"""
_FLAGS = (
    common.ADSB_FLAGS_VALID_COORDS
    | common.ADSB_FLAGS_VALID_ALTITUDE
    | common.ADSB_FLAGS_VALID_HEADING
    | common.ADSB_FLAGS_VALID_VELOCITY
    | common.ADSB_FLAGS_VALID_CALLSIGN
    | common.ADSB_FLAGS_SIMULATED
)


def load_traffic(instance: int, position: Any) -> Any:
    """ADSB_VEHICLE of the load of an instance, from its GLOBAL_POSITION_INT."""
    course = math.degrees(math.atan2(position.vy, position.vx)) % 360.0
    return common.MAVLink_adsb_vehicle_message(
        ICAO_address=load_system(instance),
        lat=position.lat,
        lon=position.lon,
        altitude_type=common.ADSB_ALTITUDE_TYPE_GEOMETRIC,
        altitude=position.alt,
        heading=round(100.0 * course) % _FULL_CIRCLE,
        hor_velocity=min(round(math.hypot(position.vx, position.vy)), 0xFFFF),
        ver_velocity=min(-position.vz, 0x7FFF),
        callsign=f"LOAD{instance}".encode(),
        emitter_type=common.ADSB_EMITTER_TYPE_LIGHTER_AIR,
        tslc=1,
        flags=_FLAGS,
        squawk=0,
    )
