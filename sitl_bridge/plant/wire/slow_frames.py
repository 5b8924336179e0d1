"""What the plant says now and then, in front of a tick's HIL_SENSOR: the load, its tracker, the battery.

The load is a MAVLink system of its own, after ArduPilot's simulated slung payload: HEARTBEAT of type AIRSHIP
and GLOBAL_POSITION_INT. Ground stations that draw only aircraft with an autopilot get it as ADSB_VEHICLE too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import common

from sitl_bridge.frames import (
    CENTIAMPERES_PER_AMPERE,
    CENTIMETRES_PER_METRE,
    DEG_E7_PER_DEG,
    MICROSECONDS_PER_SECOND,
    MILLIAMPERE_HOURS_PER_AMPERE_HOUR,
    MILLIMETRES_PER_METRE,
    PERCENT,
    STANDARD_GRAVITY,
    LocalOrigin,
    enu_to_ned,
    flu_to_frd,
)
from sitl_bridge.mavlink.fields import NOT_KNOWN_INT16, NOT_KNOWN_UINT16, pack_voltages, whole
from sitl_bridge.mavlink.framing import Packer
from sitl_bridge.mavlink.hil import FRAME_BODY_FRD
from sitl_bridge.plant.physics.battery import BatteryReading
from sitl_bridge.plant.physics.cables.hoist import Reel
from sitl_bridge.plant.physics.state import LOAD_POSITION, LOAD_VELOCITY, Array
from sitl_bridge.plant.sensors.tracker import Sighting
from sitl_bridge.vehicle.description import Battery, Winch

HEARTBEAT_INTERVAL = 1.0
POSITION_INTERVAL = 0.2
BATTERY_INTERVAL = 0.5
WINCH_INTERVAL = 0.05


def load_heartbeat() -> Any:
    """HEARTBEAT of a body without autopilot, modes and arming."""
    return _heartbeat(common.MAV_TYPE_AIRSHIP, common.MAV_STATE_ACTIVE)


def plant_heartbeat() -> Any:
    """HEARTBEAT of a plant whose time stands still: it is there."""
    return _heartbeat(common.MAV_TYPE_ONBOARD_CONTROLLER, common.MAV_STATE_STANDBY)


def _heartbeat(kind: int, status: int) -> Any:
    return common.MAVLink_heartbeat_message(
        type=kind,
        autopilot=common.MAV_AUTOPILOT_INVALID,
        base_mode=0,
        custom_mode=0,
        system_status=status,
        mavlink_version=3,
    )


class LoadOnMap:
    """Where the load is, as messages for maps; state x (19,), world ENU, m and m/s."""

    def __init__(self, origin: LocalOrigin) -> None:
        self._origin = origin

    def global_position(self, time_usec: int, x: Array) -> Any:
        """GLOBAL_POSITION_INT; a point has no heading."""
        east, north, up = x[LOAD_POSITION].tolist()
        point = self._origin.geodetic((east, north, up))
        v_east, v_north, v_up = (CENTIMETRES_PER_METRE * v for v in x[LOAD_VELOCITY].tolist())
        vx, vy, vz = (whole(v, 16) for v in enu_to_ned((v_east, v_north, v_up)))
        return common.MAVLink_global_position_int_message(
            time_boot_ms=(time_usec // 1000) & 0xFFFFFFFF,
            lat=whole(point.latitude * DEG_E7_PER_DEG, 32),
            lon=whole(point.longitude * DEG_E7_PER_DEG, 32),
            alt=whole(point.altitude * MILLIMETRES_PER_METRE, 32),
            relative_alt=whole(up * MILLIMETRES_PER_METRE, 32),
            vx=vx,
            vy=vy,
            vz=vz,
            hdg=NOT_KNOWN_UINT16,
        )


def battery_status(battery: Battery, now: BatteryReading) -> Any:
    """BATTERY_STATUS; the pack's voltage as a whole, for its cells are not measured."""
    used = (1.0 - now.remaining) * battery.capacity
    return common.MAVLink_battery_status_message(
        id=0,
        battery_function=common.MAV_BATTERY_FUNCTION_ALL,
        type=common.MAV_BATTERY_TYPE_LIPO,
        temperature=NOT_KNOWN_INT16,
        voltages=pack_voltages(now.voltage),
        current_battery=whole(now.current * CENTIAMPERES_PER_AMPERE, 16),
        current_consumed=round(used * MILLIAMPERE_HOURS_PER_AMPERE_HOUR),
        energy_consumed=-1,
        battery_remaining=round(now.remaining * PERCENT),
    )


def winch_status(time_usec: int, reel: Reel, winch: Winch) -> Any:
    """WINCH_STATUS: rest length, rate and tension of the cable; nothing is known of the motor's supply."""
    status = common.MAV_WINCH_STATUS_HEALTHY
    if reel.length <= winch.min_length:
        status |= common.MAV_WINCH_STATUS_FULLY_RETRACTED
    if reel.rate != 0.0:
        status |= common.MAV_WINCH_STATUS_MOVING
    if reel.free:  # "engaged allowing motor to move freely", as MAVLink has it
        status |= common.MAV_WINCH_STATUS_CLUTCH_ENGAGED
    return common.MAVLink_winch_status_message(
        time_usec=time_usec,
        line_length=reel.length,
        speed=reel.rate,
        tension=reel.tension / STANDARD_GRAVITY,  # kg
        voltage=math.nan,
        current=math.nan,
        temperature=NOT_KNOWN_INT16,
        status=status,
    )


def landing_target(time_usec: int, seen: Sighting) -> Any:
    """LANDING_TARGET of the tracker: where the load is from the vehicle, m, BODY_FRD, at its exposure.

    Angles are those of the image of a camera that looks down with its upper edge ahead: positive to the right
    and to the rear.
    """
    x, y, z = flu_to_frd(seen.position)
    return common.MAVLink_landing_target_message(
        time_usec=max(0, time_usec - round(seen.age * MICROSECONDS_PER_SECOND)),
        target_num=0,
        frame=FRAME_BODY_FRD,
        angle_x=math.atan2(y, z),
        angle_y=math.atan2(-x, z),
        distance=math.sqrt(x * x + y * y + z * z),
        size_x=0.0,
        size_y=0.0,
        x=x,
        y=y,
        z=z,
        q=(1.0, 0.0, 0.0, 0.0),
        type=common.LANDING_TARGET_TYPE_VISION_OTHER,
        position_valid=1,
    )


class SlowFrames:
    """Decides what is due at a tick; each tick is asked for once, in turn."""

    def __init__(
        self,
        load_map: LoadOnMap,
        load: Packer,
        vehicle: Packer,
        battery: Battery | None,
        winch: Winch | None,
        rate_hz: float,
    ) -> None:
        """load, vehicle: pack frames of the load's and the vehicle's system."""
        self._map = load_map
        self._load, self._vehicle = load, vehicle
        self._battery, self._winch = battery, winch
        self._heartbeat_every, self._position_every, self._battery_every, self._winch_every = (
            max(1, round(interval * rate_hz))
            for interval in (HEARTBEAT_INTERVAL, POSITION_INTERVAL, BATTERY_INTERVAL, WINCH_INTERVAL)
        )

    def ticks_left(self, tick: int) -> int:
        """How many ticks after `tick` nothing is due (but sightings)."""
        intervals = [self._heartbeat_every, self._position_every, self._battery_every]
        if self._winch is not None:
            intervals.append(self._winch_every)
        return min(every - 1 - tick % every for every in intervals)

    def frames(
        self,
        tick: int,
        time_usec: int,
        x: Array,
        power: BatteryReading | None,
        seen: Sighting | None,
        reel: Callable[[], Reel],
    ) -> bytes:
        """All that is due, one behind the other."""
        out = b""
        if tick % self._heartbeat_every == 0:
            out += self._load.pack(load_heartbeat())
        if tick % self._position_every == 0:
            out += self._load.pack(self._map.global_position(time_usec, x))
        if power is not None and self._battery is not None and tick % self._battery_every == 0:
            out += self._vehicle.pack(battery_status(self._battery, power))
        if self._winch is not None and tick % self._winch_every == 0:
            out += self._vehicle.pack(winch_status(time_usec, reel(), self._winch))
        if seen is not None:
            out += self._vehicle.pack(landing_target(time_usec, seen))
        return out
