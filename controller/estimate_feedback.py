"""Flying on the estimate: HIL_SENSOR, HIL_GPS and LANDING_TARGET go into the estimator, tick by tick."""

from __future__ import annotations

from typing import Any

import numpy as np
from pymavlink.dialects.v20.common import MAVLINK_MSG_ID_LANDING_TARGET

from controller.estimate_log import EstimateLog
from controller.estimator.filter import Estimator
from controller.estimator.tuning import Tuning, from_sensors
from controller.hil.ticks import Tick, TickReader
from controller.model import rotor_time_constant
from controller.state import Array
from sitl_bridge.frames import MICROSECONDS_PER_SECOND, LocalOrigin, fix_from_wire, flu_to_frd
from sitl_bridge.magnetic import field_at
from sitl_bridge.mavlink.framing import decode
from sitl_bridge.mavlink.hil import FRAME_BODY_FRD
from sitl_bridge.vehicle import Vehicle

ALIGNMENT_TIME = 1.0
"""From the first tick, or from the one with which the plant's sensors began, to arming, s."""
_PARTS = 16
"""Late measurements belong to the nearest sixteenth of a tick: the wire's microseconds are rounded, and how
depends on when the plant was started."""
_LEAST_STD = 0.005
"""m; no tracker is taken for better."""
_FIX_3D = 3


def tuning_for(vehicle: Vehicle, rate_hz: float) -> Tuning:
    """What the filter assumes of the sensors and surroundings that a vehicle description has."""
    return from_sensors(
        vehicle.sensors,
        rate_hz,
        field_at(vehicle.home),
        has_ground=vehicle.ground is not None,
        rotor_time_constant=rotor_time_constant(vehicle),
    )


class EstimateFeedback:
    """The estimator on HIL_SENSOR and HIL_GPS.

    It aligns at rest from the tick on with which the plant's sensors begin (HIL_SENSOR_UPDATED_RESET), and
    counts time in ticks from there, so that in lockstep the flight does not depend on who was started when.
    """

    name = "estimate"
    needs_truth = False
    plain = False

    def __init__(self, vehicle: Vehicle, rate_hz: float, log: EstimateLog | None = None) -> None:
        self.estimator = Estimator(vehicle, 1.0 / rate_hz, tuning_for(vehicle, rate_hz))
        self._rate_hz = rate_hz
        self._tracker = vehicle.sensors.tracker
        self._log = log
        self._origin = LocalOrigin(vehicle.home.latitude, vehicle.home.longitude, vehicle.home.altitude)
        self._largest_speeds = np.array([rotor.max_speed for rotor in vehicle.rotors])
        self.restart()

    def restart(self) -> None:
        """Align anew with the next tick."""
        self.estimator.reset()
        self._flying = False
        self._first_usec: int | None = None
        self._tick = self._first_flown = 0
        self._last_gps_usec = 0

    def take(self, time_usec: int, tick: Tick, reader: TickReader) -> Array | None:
        """The estimate at a new tick, once it is aligned and good enough to fly on."""
        if reader.begun:
            self.restart()
        if self._first_usec is None:
            self._first_usec = time_usec
        ticks = self._rate_hz / MICROSECONDS_PER_SECOND
        self._tick = round((time_usec - self._first_usec) * ticks)
        estimator = self.estimator
        estimator.sensed(reader.sensed)
        if tick.gps and reader.gps["fix_type"] >= _FIX_3D:
            valid_usec = int(reader.gps["time_usec"])
            valid_s = self._seconds(valid_usec)
            if valid_usec > self._last_gps_usec and valid_s >= 0.0:
                self._last_gps_usec = valid_usec
                position, velocity = fix_from_wire(reader.gps, self._origin)
                estimator.gps(valid_s, position, velocity)
        for frame in tick.others:
            if frame.message_id == MAVLINK_MSG_ID_LANDING_TARGET:
                self._see_load(decode(frame))
        estimate = estimator.tick(self._tick / self._rate_hz)
        return estimate if self._flying or self._ready() else None

    def flown(self, controls: Array) -> None:
        """Note what the rotors are told; the first time, that the vehicle flies."""
        if not self._flying:
            self._flying = True
            self._first_flown = self._tick
            self.estimator.take_off()
        if self._log is not None:
            self._log.record((self._tick - self._first_flown) / self._rate_hz, self.estimator)
        self.estimator.command(controls[: len(self._largest_speeds)] * self._largest_speeds)

    def _seconds(self, time_usec: int) -> float:
        """A time of the wire on the filter's clock, s."""
        assert self._first_usec is not None
        ticks = (time_usec - self._first_usec) * self._rate_hz / MICROSECONDS_PER_SECOND
        return round(ticks * _PARTS) / _PARTS / self._rate_hz

    def _see_load(self, target: Any) -> None:
        """LANDING_TARGET of the tracker: the load from the vehicle, BODY_FRD."""
        if self._tracker is None or not target.position_valid or target.frame != FRAME_BODY_FRD:
            return
        across = max(_LEAST_STD, self._tracker.angle_noise * target.distance)
        along = max(_LEAST_STD, self._tracker.distance_noise * target.distance)
        position = flu_to_frd((target.x, target.y, target.z))
        self.estimator.load_seen(self._seconds(target.time_usec), position, (across, across, along))

    def _ready(self) -> bool:
        if self._tick < round(ALIGNMENT_TIME * self._rate_hz):
            return False
        health = self.estimator.health()
        return health.attitude and health.velocity and health.position
