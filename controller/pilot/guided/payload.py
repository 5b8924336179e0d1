"""Gripper and winch at each tick: what they do to the flight, and the controls that work them."""

from __future__ import annotations

from pymavlink.dialects.v20 import common

from controller.feedback.assessment import Assessor
from controller.ground.commands.result import INFO, Notice
from controller.ground.flight.payload.winch import Report
from controller.ground.link.packing import decoded
from controller.ground.station import Station
from controller.law.state import Array
from controller.pilot.guided.laws import GuidedLaws
from controller.pilot.guided.stages import AT_ONCE, NEVER, Moment
from sitl_bridge.ids import CLUTCH_CONTROL, GRIPPER_CONTROL, WINCH_CONTROL
from sitl_bridge.mavlink.framing import Frame


class PayloadWork:
    """Of one vehicle, which may have neither."""

    def __init__(
        self,
        station: Station,
        assessor: Assessor,
        laws: GuidedLaws,
        controls: Array,
        rotors: int,
        period: float,
    ) -> None:
        """controls: (16,), the payload's behind those of the rotors; period: s, of a tick."""
        self._station = station
        self._assessor = assessor
        self._laws = laws
        self._controls = controls
        self._rotors = rotors
        self._period = period
        self._gripper = station.machine.payload.gripper
        self._winch = station.machine.payload.winch
        if self._gripper is not None:
            self._gripper.feels_hook = assessor.feels_hook

    def hear(self, frame: Frame) -> None:
        """The winch says how long the cable is."""
        if frame.message_id != common.MAVLINK_MSG_ID_WINCH_STATUS or self._winch is None:
            return
        status = decoded(frame)
        if status is not None:
            self._winch.heard(Report(status.line_length, status.speed, status.tension, status.status))

    def grip(self, moment: Moment) -> None:
        """Fly without the load once the gripper has let it go, and with it once it has taken it."""
        gripper, station, view = self._gripper, self._station, moment.view
        if gripper is None:
            return
        self._assessor.hook(station.armed and gripper.output > 0.0)
        rest_length = station.profile.rest_length
        if not gripper.update(view, station.armed, rest_length, moment.contact.load_attached):
            return
        view.load_attached = not gripper.released
        if gripper.released:
            self._assessor.load_released()
        text = "Load released" if gripper.released else "Load taken"
        station.announce(Notice(INFO, text), moment.now)

    def grip_due(self) -> float:
        """Until the gripper has done what it was told."""
        return NEVER if self._gripper is None or self._gripper.done else AT_ONCE

    def reel(self, moment: Moment) -> None:
        """Law and clearances follow the cable's rest length."""
        winch = self._winch
        if winch is None:
            return
        if self.reel_due() == NEVER:
            self._assessor.reeled(winch.length, winch.speed)  # a filter that has begun anew does not know
            return
        change = winch.length - self._station.profile.rest_length
        if change != 0.0:
            self._station.machine.reeled(change)
        self._laws.reeled(winch.length, change, winch.speed, moment.estimate)
        winch.advance(self._period)
        self._assessor.reeled(winch.length, winch.speed)

    def reel_due(self) -> float:
        """While the winch turns, or its cable is not what the flight knows."""
        winch = self._winch
        if winch is None:
            return NEVER
        known = winch.length == self._station.profile.rest_length
        return NEVER if winch.still and known and not self._laws.wants_designs(winch.length) else AT_ONCE

    def put_out(self, moment: Moment) -> None:
        """Controls of gripper and winch; they change when somebody is due who changes them."""
        if self._gripper is not None:
            self._controls[self._rotors + GRIPPER_CONTROL] = self._gripper.output
        if self._winch is not None:
            self._controls[self._rotors + WINCH_CONTROL] = self._winch.output
            self._controls[self._rotors + CLUTCH_CONTROL] = self._winch.clutch
