"""The load by the pendulum filter: on the stack's state and HIGHRES_IMU, with or without a load sensor."""

from __future__ import annotations

import math
from collections import deque
from enum import StrEnum
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import common as mavlink

from controller.law.state import LOAD_POSITION, LOAD_VELOCITY, VEHICLE_POSITION, Array
from controller.over.load.pendulum_filter import PendulumFilter
from controller.over.load.source import LoadSource, TruthSource, law_state
from controller.over.telemetry import Telemetry
from sitl_bridge.frames import (
    CENTIMETRES_PER_METRE,
    DEG_E7_PER_DEG,
    MICROSECONDS_PER_SECOND,
    MILLIMETRES_PER_METRE,
    Geodetic,
    Quaternion,
    Triple,
    enu_to_ned,
    flu_to_frd,
    rotate,
)
from sitl_bridge.ids import COMPONENT_LOAD
from sitl_bridge.mavlink.framing import Frame, decode
from sitl_bridge.vehicle.description import Vehicle

LOAD_GPS_DEVIATION = 0.5
"""m, of the load's own position messages."""
SIGHTING_DEVIATION = 0.05
"""m, of a tracker's sighting."""
SMOOTHING_TIME = 2.5
"""s, in which a jump of the stack's position is followed."""
MOST_SENSOR_AGE = 2.0
"""s, of the load sensor's newest message before the take-over."""
REMEMBERED = 50
"""States of the stack, in which the exposure of a sighting is found: half a second."""


class Sensor(StrEnum):
    """Of the load."""

    NONE = "none"
    TRACKER = "tracker"
    """LANDING_TARGET: where the load is from the vehicle, BODY_FRD."""
    POSITION = "position"
    """The load's own GLOBAL_POSITION_INT."""


_MESSAGES = {
    Sensor.TRACKER: mavlink.MAVLINK_MSG_ID_LANDING_TARGET,
    Sensor.POSITION: mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
}


class FilteredSource:
    """Vehicle by the stack's state, smoothed; load by the filter below it."""

    in_world = False

    def __init__(self, vehicle: Vehicle, sensor: Sensor) -> None:
        self._vehicle, self._sensor = vehicle, sensor
        self._filter: PendulumFilter | None = None
        self._time: float | None = None
        self._place: Array = np.zeros(3)
        self._heard: Any = None
        self._heard_at = -math.inf
        self._past: deque[tuple[float, Quaternion, Array]] = deque(maxlen=REMEMBERED)
        """Time by the stack's clock, attitude, and the load from the vehicle (3,), m."""

    def missing(self, telemetry: Telemetry, now: float, hanging: bool = True) -> str | None:
        """HIGHRES_IMU and the load sensor; with a position also where the stack's local frame is."""
        wanted = []
        if telemetry.last_imu is None:
            wanted.append("the stack's HIGHRES_IMU")
        if self._sensor is Sensor.POSITION and telemetry.origin is None:
            wanted.append("the stack's GPS_GLOBAL_ORIGIN")
        tracker = self._sensor is Sensor.TRACKER
        due = hanging if tracker else self._sensor is Sensor.POSITION
        if due and now - self._heard_at > MOST_SENSOR_AGE:
            message = "LANDING_TARGET" if tracker else f"GLOBAL_POSITION_INT of component {COMPONENT_LOAD}"
            wanted.append(f"{message}, the load's (`sitl plant --load-to`)")
        return ", ".join(wanted) or None

    def hear(self, frame: Frame, now: float) -> None:
        """The load sensor's message, if it is the one that is to be used."""
        if frame.message_id != _MESSAGES.get(self._sensor):
            return
        if self._sensor is Sensor.POSITION and frame.component != COMPONENT_LOAD:
            return
        try:
            message: Any = decode(frame)
        except Exception:  # pymavlink raises many kinds of errors for a payload that it can't unpack
            return
        if self._sensor is Sensor.TRACKER and not _is_sighting(message):
            return
        self._heard, self._heard_at = message, now

    def state(self, telemetry: Telemetry, now: float) -> Array | None:
        """The vehicle as the stack has it, the load as the filter has it."""
        vehicle = telemetry.vehicle
        if vehicle is None:
            return None
        if self._filter is None or self._time is None or not 0.0 <= vehicle.time_s - self._time < 1.0:
            self._place = np.array(vehicle.position)
            self._filter = PendulumFilter(self._vehicle, vehicle.position, vehicle.velocity)
            self._past.clear()
        else:
            duration = vehicle.time_s - self._time
            drift = (np.array(vehicle.position) - self._place) / SMOOTHING_TIME
            self._place += duration * (np.array(vehicle.velocity) + drift)
            self._filter.predict(self._at, vehicle.velocity, duration)
        self._time = vehicle.time_s
        if telemetry.imu:
            sample = telemetry.imu[-1]
            telemetry.imu.clear()
            self._filter.feel(vehicle.attitude, self._at, vehicle.velocity, sample.specific_force)
        self._past.append((vehicle.time_s, vehicle.attitude, self._filter.state[0:3] - self._place))
        if self._heard is not None:
            message, self._heard = self._heard, None
            if self._sensor is Sensor.TRACKER:
                self._see(self._filter, message)
            else:
                self._take_position(self._filter, telemetry, message)
        out = law_state(vehicle)
        out[VEHICLE_POSITION] = self._place
        out[LOAD_POSITION], out[LOAD_VELOCITY] = self._filter.state[0:3], self._filter.state[3:6]
        return out

    @property
    def _at(self) -> Triple:
        """Where the vehicle is, m: by its velocity at once, by its position slowly. GPS noise, of which a
        stack's position has more than its velocity, neither shakes the cable nor makes the law lean.
        """
        east, north, up = self._place.tolist()
        return (east, north, up)

    def _see(self, found: PendulumFilter, message: Any) -> None:
        """A sighting: what it differs by from what was expected at its exposure, it differs by now."""
        exposed = message.time_usec / MICROSECONDS_PER_SECOND
        _, attitude, expected = min(self._past, key=lambda past: abs(past[0] - exposed))
        seen = rotate(attitude, flu_to_frd((message.x, message.y, message.z)))
        x, y, z = (found.state[0:3] + np.array(seen) - expected).tolist()
        found.see((x, y, z), SIGHTING_DEVIATION)

    def _take_position(self, found: PendulumFilter, telemetry: Telemetry, message: Any) -> None:
        point = Geodetic(
            message.lat / DEG_E7_PER_DEG,
            message.lon / DEG_E7_PER_DEG,
            message.alt / MILLIMETRES_PER_METRE,
        )
        place = telemetry.local(point)
        if place is not None:
            speeds = (message.vx, message.vy, message.vz)
            north, east, down = (v / CENTIMETRES_PER_METRE for v in speeds)
            found.see(place, LOAD_GPS_DEVIATION, enu_to_ned((north, east, down)))


def _is_sighting(message: Any) -> bool:
    """Whether a LANDING_TARGET has a position from the vehicle."""
    finite = math.isfinite(message.x + message.y + message.z)
    return bool(message.position_valid) and message.frame == mavlink.MAV_FRAME_BODY_FRD and finite


def load_source(kind: str, vehicle: Vehicle) -> LoadSource:
    """The source of this name: truth, tracker, position or none."""
    return TruthSource() if kind == "truth" else FilteredSource(vehicle, Sensor(kind))
