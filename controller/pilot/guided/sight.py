"""The vehicle as ground control is shown it: state, contacts, health, GPS receiver and battery."""

from __future__ import annotations

import math

import numpy as np
from pymavlink.dialects.v20 import common

from controller.feedback.assessment import Assessor, Contact
from controller.ground.link.packing import decoded
from controller.ground.station import Station
from controller.ground.telemetry.vehicle_state import VehicleView
from controller.hil.ticks import TickReader
from controller.law.state import Array
from controller.pilot.guided.gps_display import Receiver
from sitl_bridge.frames import CENTIAMPERES_PER_AMPERE, PERCENT, quaternion_from_euler
from sitl_bridge.mavlink.fields import pack_voltage
from sitl_bridge.mavlink.framing import Frame
from sitl_bridge.mavlink.hil import HIL_GPS
from sitl_bridge.vehicle.description import Vehicle

ASSESSMENT_PERIOD = 0.1
"""s of the plant's time between two looks at the health of the feedback and at the GPS receiver."""


class Sight:
    """Writes a station's view; `view` is None until there is a state."""

    def __init__(self, vehicle: Vehicle, station: Station, assessor: Assessor, controls: Array) -> None:
        """controls: (16,), of the rotors, 0..1."""
        self.view: VehicleView | None = None
        self.next_assessment = -math.inf
        """The plant's time, s"""
        self._station = station
        self._assessor = assessor
        self._rotors = controls[: len(vehicle.rotors)]
        self._gps_rate = vehicle.sensors.gps.rate
        self._accelerometer: Array = np.zeros(3)
        self._receiver = Receiver(HIL_GPS.record()[0][0], self._gps_rate)

    def attend(self, reader: TickReader) -> None:
        """Where accelerometer and GPS receiver can be read."""
        self._accelerometer = reader.sensed["accelerometer"][0]
        self._receiver = Receiver(reader.gps, self._gps_rate)

    def look(self, estimate: Array, time: float, armed: bool) -> tuple[VehicleView, Contact]:
        """Write an estimate (18,), eq. 31, into the view, at the plant's time, s; what touches what in it."""
        x = estimate.tolist()
        attitude = quaternion_from_euler((x[15], x[16], x[17]))
        position, load = (x[0], x[1], x[2]), (x[3], x[4], x[5])
        if self.view is None:
            self.view = VehicleView(0.0, position, position, attitude, position, load, load)
            self.next_assessment = -math.inf
        view = self.view
        view.time = time
        view.position, view.load_position = position, load
        view.velocity, view.load_velocity = (x[6], x[7], x[8]), (x[9], x[10], x[11])
        view.attitude, view.body_rates = attitude, (x[12], x[13], x[14])
        view.acceleration = tuple(self._accelerometer.tolist())
        view.hil_age = 0.0
        view.rotors = tuple(self._rotors.tolist()) if armed else ()
        view.throttle = sum(view.rotors) / len(view.rotors) if view.rotors else 0.0
        return view, self._assessor.contact(estimate)

    def touch(self, contact: Contact) -> None:
        """Write what touches what."""
        view = self.view
        assert view is not None
        view.vehicle_on_ground, view.load_on_ground = contact.vehicle_on_ground, contact.load_on_ground
        view.cable_taut = contact.cable_taut

    def assess(self) -> list[str]:
        """Write how well the feedback and the receiver do, if it is time to; what there is to say."""
        view = self.view
        assert view is not None
        if view.time < self.next_assessment:
            return []
        self.next_assessment = view.time + ASSESSMENT_PERIOD
        view.gps = self._receiver.look(view.time)
        return self._assessor.assess(view)

    def place_by_receiver(self) -> None:
        """Vehicle and load are where the last fix was: there is one, or the filter would not have aligned."""
        view = self.view
        assert view is not None
        if view.gps.position is not None:
            view.position = view.load_position = self._station.profile.origin.local(view.gps.position)
        known = all(map(math.isfinite, view.gps.velocity))
        view.velocity = view.load_velocity = view.gps.velocity if known else (0.0, 0.0, 0.0)

    def hear(self, frame: Frame) -> None:
        """The battery is measured."""
        if frame.message_id != common.MAVLINK_MSG_ID_BATTERY_STATUS or self.view is None:
            return
        battery = decoded(frame)
        if battery is None:
            return
        self.view.battery_voltage = pack_voltage(battery.voltages)
        current, remaining = battery.current_battery, battery.battery_remaining
        self.view.battery_current = current / CENTIAMPERES_PER_AMPERE if current >= 0 else math.nan
        self.view.battery_remaining = remaining / PERCENT if remaining >= 0 else math.nan
