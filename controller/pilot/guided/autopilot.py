"""The autopilot under ground control: the station decides when to arm and where to go. No I/O.

Stages of a tick (see `stages`), behind the estimate's way into the station's view:

    stage      | what it does                                   | due
    -----------+------------------------------------------------+--------------------------------------
    gripper    | let the load go, or take it                    | until it has done what it was told
    contacts   | see what touches what; notice a load's loss    | never: `flown_whole` looks for the loss
    health     | judge the feedback and the GPS receiver        | ten times a second
    lost state | fallen over: the receiver says where it is     | while the rotors do not turn
    guidance   | ask the station what to do: `Station.update`   | fifty times a second; something came in
    designs    | take new gains                                 | while they are designed
    winch      | follow the cable's length                      | while it turns
    law        | fly: trajectory, law, allocation               | while it is not the target's own law
    outputs    | work gripper and winch                         | never: they change with the stages above
"""

from __future__ import annotations

import math

from controller.feedback.assessment import Assessor, ExactAssessor
from controller.ground.commands.result import WARNING, Notice
from controller.ground.flight.limits.preconditions import tilt
from controller.ground.station import Station
from controller.ground.telemetry.vehicle_state import VehicleView
from controller.hil.session import is_plant_heartbeat
from controller.hil.ticks import TickReader, plant_seconds
from controller.law.control_law import Law
from controller.law.state import Array
from controller.pilot.guided.laws import GuidedLaws
from controller.pilot.guided.payload import PayloadWork
from controller.pilot.guided.redesign import Redesigner
from controller.pilot.guided.sight import Sight
from controller.pilot.guided.stages import AT_ONCE, NEVER, Moment, Stage, due, never_due, run
from sitl_bridge.mavlink.framing import Frame
from sitl_bridge.vehicle.description import Vehicle


class GuidedAutopilot:
    """Station, trajectory and laws of one vehicle; `controls` (16,) are its rotor commands, 0..1."""

    def __init__(
        self,
        vehicle: Vehicle,
        rate_hz: float,
        station: Station,
        redesigner: Redesigner,
        controls: Array,
        assessor: Assessor | None = None,
    ) -> None:
        """assessor: of the feedback, by default of one that is the truth."""
        self.station = station
        station.refresh = self.refresh
        self._assessor = assessor or ExactAssessor(vehicle)
        self._sight = Sight(vehicle, station, self._assessor, controls)
        self._laws = GuidedLaws(vehicle, rate_hz, station, redesigner, controls)
        self._payload = PayloadWork(
            station, self._assessor, self._laws, controls, len(vehicle.rotors), 1.0 / rate_hz
        )
        self._heard = -math.inf
        self._source: Array = self._laws.estimate
        """Where the feedback has its estimate"""
        self._unseen: float | None = None
        """The plant's time, s, of an estimate that the view does not have yet"""
        self._due = AT_ONCE
        self._stages = (
            Stage("gripper", self._payload.grip, self._payload.grip_due),
            Stage("contacts", self._note_contacts, never_due),
            Stage("health", self._assess, lambda: self._sight.next_assessment),
            Stage("lost state", self._judge_state, self._state_due),
            Stage("guidance", self._ask_station, lambda: station.looks_at),
            Stage("designs", self._laws.take_designs, self._laws.designs_due),
            Stage("winch", self._payload.reel, self._payload.reel_due),
            Stage("law", self._laws.fly, self._laws.fly_due),
            Stage("outputs", self._payload.put_out, never_due),
        )

    @property
    def armed(self) -> bool:
        """Whether the rotors turn."""
        return self.station.armed

    @property
    def law(self) -> Law | None:
        """What the compiled tick flies, before the time that `whole_until` says."""
        return self._laws.law

    @property
    def terms(self) -> Array | None:
        """What the last command is made of, see `terms_log.Termed`."""
        return self._laws.terms

    def attend(self, reader: TickReader) -> None:
        """Ground control is shown what accelerometer and GPS receiver say."""
        self._sight.attend(reader)

    def disarm(self) -> None:
        """The plant has started again, or says no more where the vehicle is."""
        if self.station.machine.armed:
            self.station.machine.disarm(force=True)
        self._laws.stop()
        self._sight.view = self._unseen = None
        self._due = AT_ONCE
        self.station.machine.payload.restart()

    def act_late(self, ticks: int) -> None:
        """Gains that predict over the longer delay, from the next step on."""
        self._laws.act_late(ticks)

    def hear(self, frame: Frame, now: float) -> None:
        """Anything else from the plant: the load speaks for itself, battery and winch are measured."""
        self.station.hear_plant(frame, now)
        if is_plant_heartbeat(frame):  # its time stands still: nothing is lost
            self._heard = now
        self._sight.hear(frame)
        self._payload.hear(frame)
        self._due = due(self._stages)

    def wait(self, now: float) -> None:
        """No tick has come: the failsafes go on."""
        view = self._sight.view
        if view is not None:
            self.refresh()
            view.hil_age = now - self._heard
            self.station.update(view, now)

    def step(self, estimate: Array, time_usec: int, now: float) -> None:
        """One control step on an estimate (18,), eq. 31."""
        self._source = estimate
        self._laws.estimate[:] = estimate
        if plant_seconds(time_usec) < self.whole_until(now):  # what came with the tick had to be taken apart
            self._laws.go_on()
            self.flown_whole(time_usec, now)
            return
        self._unseen = None
        self._heard = now
        first = self._sight.view is None
        view, contact = self._sight.look(estimate, plant_seconds(time_usec), self.armed)
        moment = Moment(self._laws.estimate, view, contact, now, self.station.machine.target, first)
        run(self._stages, moment)
        self._due = due(self._stages)

    def whole_until(self, now: float) -> float:
        """The plant's time, s, before which `step` would do no more than the compiled tick."""
        station = self.station
        return self._due if station.armed and not station.looks_now(now) else AT_ONCE

    def flown_whole(self, time_usec: int, now: float) -> None:
        """The compiled tick was flown instead of `step`."""
        self._heard = now
        self._unseen = time = plant_seconds(time_usec)
        self.station.plant_clock.note(time, now)
        view = self._sight.view
        assert view is not None
        if view.load_attached and not self._assessor.attached(self._source):
            self._lose_load(view, now)

    def refresh(self) -> None:
        """Bring the station's view up to date with the last tick."""
        if self._unseen is not None:
            _, contact = self._sight.look(self._source, self._unseen, self.armed)
            self._sight.touch(contact)
            self._unseen = None

    # Stages

    def _note_contacts(self, moment: Moment) -> None:
        if moment.view.load_attached and not moment.contact.load_attached:
            self._lose_load(moment.view, moment.now)
        self._sight.touch(moment.contact)

    def _lose_load(self, view: VehicleView, now: float) -> None:
        view.load_attached = False  # for good: it may well lie within reach again
        self.station.announce(Notice(WARNING, "The load is lost: flying without it"), now)

    def _assess(self, moment: Moment) -> None:
        for text in self._sight.assess():
            self.station.announce(Notice(WARNING, text), moment.now)

    def _judge_state(self, moment: Moment) -> None:
        if not moment.view.estimated:
            self._sight.place_by_receiver()
        elif not self.armed and tilt(moment.view) > math.radians(self.station.parameters["FD_FAIL_TILT"]):
            self._assessor.give_up()

    def _state_due(self) -> float:
        view = self._sight.view
        return NEVER if view is not None and view.estimated and self.armed else AT_ONCE

    def _ask_station(self, moment: Moment) -> None:
        if moment.first and moment.contact.in_flight:
            self.station.machine.resume(moment.view, moment.now)
        moment.target = self.station.update(moment.view, moment.now)
