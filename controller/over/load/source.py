"""Where the load is, by what there is: the plant's truth, its own position messages, or no sensor at all.

Each source makes the law's state (18,), eq. 31, from the stack's telemetry and what it hears itself.
"""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np
from pymavlink.dialects.v20 import common as mavlink

from controller.law.state import (
    BODY_RATES,
    EULER_ANGLES,
    LOAD_POSITION,
    LOAD_VELOCITY,
    STATE_SIZE,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
    Array,
)
from controller.over.load.pendulum_filter import PendulumFilter
from controller.over.telemetry import Telemetry, VehicleState
from sitl_bridge.frames import (
    CENTIMETRES_PER_METRE,
    DEG_E7_PER_DEG,
    MILLIMETRES_PER_METRE,
    Geodetic,
    Triple,
    attitude_to_enu_flu,
    enu_to_ned,
    euler_from_quaternion,
    flu_to_frd,
    rotate,
)
from sitl_bridge.ids import COMPONENT_LOAD
from sitl_bridge.mavlink.framing import Frame, decode
from sitl_bridge.vehicle.description import Vehicle

LOAD_GPS_DEVIATION = 0.5
"""m, of the load's own position messages."""
MOST_TRUTH_AGE = 0.2
"""s"""
SMOOTHING_TIME = 2.5
"""s, in which a jump of the stack's position is followed."""
MOST_POSITION_AGE = 2.0
"""s"""


class LoadSource(Protocol):
    """Knows the load beside the stack's vehicle."""

    in_world: bool
    """Whether the state is in the scenario's frame; else it is in the stack's local one."""

    def hear(self, frame: Frame, now: float) -> None:
        """Anything that a link brings, the truth's link included."""

    def state(self, telemetry: Telemetry, now: float) -> Array | None:
        """The law's state (18,) at the stack's newest state; None while there is none to fly on."""

    def missing(self, telemetry: Telemetry, now: float) -> str | None:
        """What has to come before there is a state, in words; None: nothing."""


def law_state(vehicle: VehicleState) -> Array:
    """The vehicle's part of eq. 31 (18,)."""
    out = np.zeros(STATE_SIZE)
    out[VEHICLE_POSITION], out[VEHICLE_VELOCITY] = vehicle.position, vehicle.velocity
    out[BODY_RATES] = vehicle.rates
    out[EULER_ANGLES] = euler_from_quaternion(vehicle.attitude)
    return out


class TruthSource:
    """The plant's ODOMETRY of vehicle and load (`sitl plant --truth-to`)."""

    in_world = True

    def __init__(self) -> None:
        self._vehicle: VehicleState | None = None
        self._load: tuple[tuple[float, ...], tuple[float, ...]] | None = None
        self._at = -math.inf

    def hear(self, frame: Frame, now: float) -> None:
        """ODOMETRY of the load, and of the vehicle by the plant's own component."""
        if frame.message_id != mavlink.MAVLINK_MSG_ID_ODOMETRY:
            return
        message: Any = decode(frame)
        place = enu_to_ned((message.x, message.y, message.z))
        if frame.component == COMPONENT_LOAD:
            self._load = (place, enu_to_ned((message.vx, message.vy, message.vz)))
        elif frame.component == mavlink.MAV_COMP_ID_ONBOARD_COMPUTER:
            attitude = attitude_to_enu_flu(tuple(message.q))
            velocity = rotate(attitude, flu_to_frd((message.vx, message.vy, message.vz)))
            rates = flu_to_frd((message.rollspeed, message.pitchspeed, message.yawspeed))
            self._vehicle = VehicleState(message.time_usec * 1e-6, place, velocity, attitude, rates)
            self._at = now

    @property
    def time_s(self) -> float | None:
        """The plant's time of the newest state, s; None: there is none."""
        return None if self._vehicle is None else self._vehicle.time_s

    def missing(self, telemetry: Telemetry, now: float) -> str | None:
        """ODOMETRY of both bodies."""
        if self._vehicle is None or self._load is None:
            return "the plant's ODOMETRY of vehicle and load (`sitl plant --truth-to`)"
        if now - self._at > MOST_TRUTH_AGE:
            return "new ODOMETRY from the plant"
        return None

    def state(self, telemetry: Telemetry, now: float) -> Array | None:
        """Vehicle and load as the plant has them."""
        if self._vehicle is None or self._load is None or now - self._at > MOST_TRUTH_AGE:
            return None
        out = law_state(self._vehicle)
        out[LOAD_POSITION], out[LOAD_VELOCITY] = self._load
        return out


class FilteredSource:
    """The pendulum filter on the stack's state and HIGHRES_IMU, with the load's own position if asked for."""

    in_world = False

    def __init__(self, vehicle: Vehicle, uses_position: bool) -> None:
        self._vehicle = vehicle
        self._uses_position = uses_position
        self._filter: PendulumFilter | None = None
        self._time: float | None = None
        self._place: Array = np.zeros(3)
        self._heard: list[Any] = []
        self._heard_at = -math.inf

    def missing(self, telemetry: Telemetry, now: float) -> str | None:
        """HIGHRES_IMU; with the load's position that one, and where the stack's local frame is."""
        wanted = []
        if telemetry.last_imu is None:
            wanted.append("the stack's HIGHRES_IMU")
        if self._uses_position and telemetry.origin is None:
            wanted.append("the stack's GPS_GLOBAL_ORIGIN")
        if self._uses_position and now - self._heard_at > MOST_POSITION_AGE:
            wanted.append("GLOBAL_POSITION_INT of the load (component 35)")
        return ", ".join(wanted) or None

    def hear(self, frame: Frame, now: float) -> None:
        """GLOBAL_POSITION_INT of the load, where it is to be used."""
        position = frame.message_id == mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
        if self._uses_position and position and frame.component == COMPONENT_LOAD:
            self._heard.append(decode(frame))
            self._heard_at = now

    def state(self, telemetry: Telemetry, now: float) -> Array | None:
        """The vehicle as the stack has it, the load as the filter has it."""
        vehicle = telemetry.vehicle
        if vehicle is None:
            return None
        if self._filter is None or self._time is None or not 0.0 <= vehicle.time_s - self._time < 1.0:
            self._place = np.array(vehicle.position)
            self._filter = PendulumFilter(self._vehicle, vehicle.position, vehicle.velocity)
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
        self._take_positions(telemetry, self._filter)
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

    def _take_positions(self, telemetry: Telemetry, found: PendulumFilter) -> None:
        heard, self._heard = self._heard, []
        for message in heard[-1:]:
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


def load_source(kind: str, vehicle: Vehicle) -> LoadSource:
    """The source of this name: truth, position or none."""
    if kind == "truth":
        return TruthSource()
    return FilteredSource(vehicle, uses_position=kind == "position")
