"""The autopilot under ground control: the station decides when to arm and where to go. No I/O.

Two laws fly it: one for the vehicle on a slack cable, one for the load once that hangs.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np
from pymavlink.dialects.v20 import common

from controller.design.catalogue import EVEN, Emphasis, guided_designs
from controller.feedback.assessment import Assessor, Contact, ExactAssessor
from controller.ground.commands.result import INFO, WARNING, Notice
from controller.ground.flight.limits.preconditions import tilt
from controller.ground.flight.motion.setpoint_types import (
    Attitude,
    Body,
    Follow,
    Goto,
    Idle,
    Land,
    Target,
    Terminate,
)
from controller.ground.flight.motion.trajectory import Limits, Trajectory, motion_pole
from controller.ground.flight.payload.winch import Report
from controller.ground.link.packing import decoded
from controller.ground.station import Station
from controller.ground.telemetry.vehicle_state import VehicleView
from controller.hil.session import is_plant_heartbeat
from controller.hil.ticks import TickReader
from controller.law import bumpless_transfer as handover
from controller.law.allocation import allocation
from controller.law.attitude_law import attitude_law, attitude_step, set_limits
from controller.law.control_law import WORK, Design, Memory, engaged_memory
from controller.law.control_step import control_step
from controller.law.state import (
    EULER_ANGLES,
    LOAD_POSITION,
    LOAD_VELOCITY,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
    Array,
)
from controller.pilot.gps_display import Receiver
from sitl_bridge.frames import CENTIAMPERES_PER_AMPERE, PERCENT, Triple, quaternion_from_euler
from sitl_bridge.ids import CLUTCH_CONTROL, GRIPPER_CONTROL, WINCH_CONTROL
from sitl_bridge.mavlink.fields import pack_voltage
from sitl_bridge.mavlink.framing import Frame
from sitl_bridge.mavlink.hil import HIL_GPS
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.rotors import full_thrust

IDLE_COMMAND = 0.08
"""Rotors of a vehicle that is armed on the ground, as a share of their largest speed."""
ASSESSMENT_PERIOD = 0.1
"""s of the plant's time between two looks at the health of the feedback and at the GPS receiver."""
REACH = 0.3
"""m, beyond a hanging load's distance, to which the vehicle pulls to lift the load off."""
PICK_UP_SPEED = 0.4
"""m/s, largest, at which it does."""
REDESIGN_SHARE = 0.1
"""Of the cable's length, by which a winch changes it until gains are designed for it"""
THRUST_SHARE = 0.85
"""Of all rotors' thrust, that motions are planned with; the rest is for the feedback."""
LEAST_ACCELERATION = 0.5
"""m/s², planned with in any case"""

WEIGHTS = {
    "LQR_Q_VPOS": "vehicle_position",
    "LQR_Q_LPOS": "load_position",
    "LQR_Q_VVEL": "vehicle_velocity",
    "LQR_Q_LVEL": "load_velocity",
    "LQR_Q_RATE": "body_rates",
    "LQR_Q_ATT": "attitude",
    "LQR_Q_INT": "integral",
    "LQR_R_THRUST": "thrust",
    "LQR_R_MOMENT": "moments",
}
"""Parameters that weigh the designs, and what of `Emphasis` they are."""


class Redesigner(Protocol):
    """Makes designs in the background."""

    def request(self, emphasis: Emphasis, rest_length: float) -> None:
        """Begin to design, for a cable of this length (m); what was under way is given up."""

    def result(self) -> tuple[Design, Design] | str | None:
        """The designs of the last request, once, when they are there; or why there are none."""


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
        self._assessor = assessor or ExactAssessor(vehicle)
        self._next_assessment = -math.inf
        self._vehicle = vehicle
        self._period = 1.0 / rate_hz
        self._redesigner = redesigner
        self._controls = controls
        self._allocation = allocation(vehicle)
        self._gripper_control = len(vehicle.rotors) + GRIPPER_CONTROL
        self._winch_control = len(vehicle.rotors) + WINCH_CONTROL
        self._clutch_control = len(vehicle.rotors) + CLUTCH_CONTROL
        self._designed_length = self._wanted_length = vehicle.cable.rest_length
        """m, of the cable that the gains are for, or will be"""
        self._designing = self._new_weights = False
        gripper = station.machine.payload.gripper
        if gripper is not None:
            gripper.feels_hook = self._assessor.feels_hook
        self._designs = dict(zip((Body.LOAD, Body.VEHICLE), guided_designs(vehicle, rate_hz), strict=True))
        self._trajectory = Trajectory(self._period, motion_pole(vehicle.hover_length, vehicle.gravity))
        thrust = full_thrust(vehicle.rotors)
        weight = vehicle.gravity * (vehicle.airframe.mass + vehicle.load.mass)
        spare = THRUST_SHARE * thrust / weight - 1.0
        self._most_acceleration = max(LEAST_ACCELERATION, spare * vehicle.gravity)
        self._work = np.zeros(1, dtype=WORK)
        self._estimate = np.zeros(18)
        self._attitude_law = attitude_law(vehicle, rate_hz)
        self._attitude_step = attitude_step.bind(
            self._attitude_law, self._allocation, self._work, self._estimate, self._controls
        )
        self._steered = False
        """The client steers attitude and thrust: the attitude law flies"""
        self._law: Body | None = None
        """The law that flies; None on the ground"""
        self._memory: Memory = engaged_memory(np.zeros(3))
        self._step: Callable[[], int] = self._bound(Body.VEHICLE)  # compiled code is loaded now
        self._pulling: tuple[Target, Goto] | None = None
        """A target for the load, and what the vehicle does for it while the load lies"""
        self._view: VehicleView | None = None
        self._heard = -math.inf
        self._accelerometer: Array = np.zeros(3)
        self._receiver = Receiver(HIL_GPS.record()[0][0], vehicle.sensors.gps.rate)

    law = None
    """Ground control may want something else at any step."""

    @property
    def armed(self) -> bool:
        """Whether the rotors turn."""
        return self.station.armed

    @property
    def terms(self) -> Array | None:
        """What the last command is made of, see `terms_log.Termed`."""
        return None if self._law is None and not self._steered else self._work["terms"].reshape(-1)

    def attend(self, reader: TickReader) -> None:
        """Ground control is shown what accelerometer and GPS receiver say."""
        self._accelerometer = reader.sensed["accelerometer"][0]
        self._receiver = Receiver(reader.gps, self._vehicle.sensors.gps.rate)

    def disarm(self) -> None:
        """The plant has started again, or says no more where the vehicle is."""
        if self.station.machine.armed:
            self.station.machine.disarm(force=True)
        self._law = None
        self._view = None
        self.station.machine.payload.restart()

    def hear(self, frame: Frame, now: float) -> None:
        """Anything else from the plant: the load speaks for itself, and the battery is measured."""
        self.station.hear_plant(frame, now)
        if is_plant_heartbeat(frame):  # its time stands still: nothing is lost
            self._heard = now
        winch = self.station.machine.payload.winch
        if frame.message_id == common.MAVLINK_MSG_ID_WINCH_STATUS and winch is not None:
            status = decoded(frame)
            if status is not None:
                winch.heard(Report(status.line_length, status.speed, status.tension, status.status))
        if frame.message_id == common.MAVLINK_MSG_ID_BATTERY_STATUS and self._view is not None:
            battery = decoded(frame)
            if battery is None:
                return
            self._view.battery_voltage = pack_voltage(battery.voltages)
            current, remaining = battery.current_battery, battery.battery_remaining
            self._view.battery_current = current / CENTIAMPERES_PER_AMPERE if current >= 0 else math.nan
            self._view.battery_remaining = remaining / PERCENT if remaining >= 0 else math.nan

    def wait(self, now: float) -> None:
        """No tick has come: the failsafes go on."""
        if self._view is not None:
            self._view.hil_age = now - self._heard
            self.station.update(self._view, now)

    def step(self, estimate: Array, time_usec: int, now: float) -> None:
        """One control step on an estimate (18,), eq. 31."""
        self._estimate[:] = estimate
        self._heard = now
        view, contact, first = self._seen(estimate, time_usec, now)
        if first and contact.in_flight:
            self.station.machine.resume(view, now)
        target = self.station.update(view, now)
        self._take_designs()
        self._follow_winch()
        self._fly(target, estimate, view, contact)
        payload = self.station.machine.payload
        if payload.gripper is not None:
            self._controls[self._gripper_control] = payload.gripper.output
        if payload.winch is not None:
            self._controls[self._winch_control] = payload.winch.output
            self._controls[self._clutch_control] = payload.winch.clutch

    def _seen(self, estimate: Array, time_usec: int, now: float) -> tuple[VehicleView, Contact, bool]:
        """The view of an estimate, what touches what in it, and whether it is the first."""
        x = estimate.tolist()
        attitude = quaternion_from_euler((x[15], x[16], x[17]))
        position, load = (x[0], x[1], x[2]), (x[3], x[4], x[5])
        first = self._view is None
        if self._view is None:
            self._view = VehicleView(0.0, position, position, attitude, position, load, load)
        view = self._view
        view.time = time_usec * 1e-6
        view.position, view.load_position = position, load
        view.velocity, view.load_velocity = (x[6], x[7], x[8]), (x[9], x[10], x[11])
        view.attitude, view.body_rates = attitude, (x[12], x[13], x[14])
        view.acceleration = tuple(self._accelerometer.tolist())
        contact = self._assessor.contact(estimate)
        self._work_gripper(view, contact, now)
        if view.load_attached and not contact.load_attached:  # for good: it may well lie within reach again
            view.load_attached = False
            self.station.announce(Notice(WARNING, "The load is lost: flying without it"), now)
        view.vehicle_on_ground, view.load_on_ground = contact.vehicle_on_ground, contact.load_on_ground
        view.cable_taut = contact.cable_taut
        if first or view.time >= self._next_assessment:
            self._next_assessment = view.time + ASSESSMENT_PERIOD
            view.gps = self._receiver.look(view.time)
            for text in self._assessor.assess(view):
                self.station.announce(Notice(WARNING, text), now)
        if not view.estimated:
            self._place_by_receiver(view)
        elif not self._turning and tilt(view) > math.radians(self.station.parameters["FD_FAIL_TILT"]):
            self._assessor.give_up()
        view.hil_age = 0.0
        view.throttle = float(self._controls[: len(self._vehicle.rotors)].mean()) if self.armed else 0.0
        return view, contact, first

    @property
    def _turning(self) -> bool:
        """Whether the rotors are to turn."""
        return self.armed and not self.station.machine.terminated

    def _place_by_receiver(self, view: VehicleView) -> None:
        """Vehicle and load are where the last fix was: there is one, or the filter would not have aligned."""
        if view.gps.position is not None:
            view.position = view.load_position = self.station.profile.origin.local(view.gps.position)
        known = all(map(math.isfinite, view.gps.velocity))
        view.velocity = view.load_velocity = view.gps.velocity if known else (0.0, 0.0, 0.0)

    def _follow_winch(self) -> None:
        """Law and clearances follow the cable's rest length; gains are designed anew from a tenth on.

        Seen from a load that sinks at the winch's rate the vehicle sinks with it, as on a cable of constant
        length.
        """
        winch = self.station.machine.payload.winch
        if winch is None:
            return
        change = winch.length - self.station.profile.rest_length
        if change != 0.0:
            self.station.machine.reeled(change)
            self._designs[Body.LOAD]["body"]["rest_length"] = winch.length
        hangs = self._law is Body.LOAD
        self._trajectory.lower(change if hangs else 0.0, winch.speed if hangs else 0.0)
        if hangs:
            self._estimate[VEHICLE_VELOCITY.stop - 1] -= winch.speed
        if not self._designing and abs(winch.length / self._designed_length - 1.0) > REDESIGN_SHARE:
            self._request_designs(winch.length)
        winch.advance(self._period)
        self._assessor.reeled(winch.length, winch.speed)

    def _request_designs(self, rest_length: float) -> None:
        p = self.station.parameters
        self._designing, self._wanted_length = True, rest_length
        emphasis = EVEN._replace(**{field: p[name] for name, field in WEIGHTS.items()})
        self._redesigner.request(emphasis, rest_length)

    def _work_gripper(self, view: VehicleView, contact: Contact, now: float) -> None:
        """Fly without the load once the gripper has let it go, and with it once it has taken it."""
        gripper = self.station.machine.payload.gripper
        if gripper is None:
            return
        self._assessor.hook(self.armed and gripper.output > 0.0)
        rest_length = self.station.profile.rest_length
        if not gripper.update(view, self.armed, rest_length, contact.load_attached):
            return
        view.load_attached = not gripper.released
        if gripper.released:
            self._assessor.load_released()
        text = "Load released" if gripper.released else "Load taken"
        self.station.announce(Notice(INFO, text), now)

    def _fly(self, target: Target, estimate: Array, view: VehicleView, contact: Contact) -> None:
        if isinstance(target, Attitude):
            self._steer(target)
            return
        if isinstance(target, Idle | Terminate):
            self._law = None
            self._steered = False
            self._controls[: len(self._vehicle.rotors)] = IDLE_COMMAND
            return
        body = self._body_for(target, contact)
        if body is not self._law:
            self._engage(body, estimate)
        if body is not target.body:
            target = self._pull(target, view)
        self._trajectory.advance(target, self._limits(), float(self._memory["ticks"][0]) * self._period)
        self._step()

    def _steer(self, target: Attitude) -> None:
        """One step of the attitude law."""
        law, p = self._attitude_law, self.station.parameters
        if not self._steered:
            law["integral"] = 0.0
        self._law, self._steered = None, True
        set_limits(
            law,
            (p["MC_ROLL_P"], p["MC_PITCH_P"], p["MC_YAW_P"]),
            (
                math.radians(p["MC_ROLLRATE_MAX"]),
                math.radians(p["MC_PITCHRATE_MAX"]),
                math.radians(p["MC_YAWRATE_MAX"]),
            ),
        )
        law["has_attitude"] = target.attitude is not None
        if target.attitude is not None:
            law["attitude"] = target.attitude
        law["rate"] = target.body_rates
        law["thrust"] = target.thrust / p["MPC_THR_HOVER"] * self._vehicle.hover_thrust
        self._attitude_step()

    def _body_for(self, target: Goto | Follow | Land, contact: Contact) -> Body:
        """Which law is to fly: the load's when the load hangs, and for as long as it is asked for."""
        if target.body is Body.VEHICLE or self._law is Body.LOAD:
            return target.body
        return Body.LOAD if contact.load_lifted else Body.VEHICLE

    def _pull(self, target: Goto | Follow | Land, view: VehicleView) -> Goto:
        """The vehicle alone rises above a load that lies, until it hangs."""
        if self._pulling is None or self._pulling[0] is not target:
            x, y, z = view.load_position
            above: Triple = (x, y, z + self.station.profile.hover_length + REACH)
            yaw = float(self._trajectory.path["yaw"][0]) if math.isnan(target.yaw) else target.yaw
            goto = Goto(Body.VEHICLE, above, yaw, PICK_UP_SPEED)
            self._pulling = (target, goto)
        return self._pulling[1]

    def _engage(self, body: Body, estimate: Array) -> None:
        """Hand over to a law: its reference starts with the body's motion, what the rotors give goes on."""
        position, velocity = (
            (LOAD_POSITION, LOAD_VELOCITY) if body is Body.LOAD else (VEHICLE_POSITION, VEHICLE_VELOCITY)
        )
        yaw = float(estimate[EULER_ANGLES][2] if self._law is None else self._trajectory.path["yaw"][0])
        memory = engaged_memory(estimate[position])
        before = self._memory if self._law is not None else None
        moves = estimate[velocity].copy()
        winch = self.station.machine.payload.winch
        if body is Body.LOAD and winch is not None:  # what the winch adds comes by `lower`
            moves[2] += winch.speed
        self._trajectory.start(estimate[position], moves, yaw)
        if before is not None and self._law is not None:
            handover.other_body(self._designs[self._law], self._designs[body], before, memory)
        if self._steered:
            handover.from_wrench(self._designs[body], self._work["achieved"][0], memory)
            self._steered = False
        self._law, self._memory = body, memory
        self._step = self._bound(body)

    def _bound(self, body: Body) -> Callable[[], int]:
        return control_step.bind(
            self._designs[body],
            self._allocation,
            self._trajectory.path,
            self._memory,
            self._work,
            self._estimate,
            self._controls,
        )

    def _limits(self) -> Limits:
        p = self.station.parameters
        total = min(p["MPC_ACC_HOR_MAX"], self._most_acceleration)
        return Limits(
            min(p["MPC_ACC_HOR"], total),
            total,
            p["MPC_XY_VEL_MAX"],
            p["MPC_Z_VEL_MAX_UP"],
            p["MPC_Z_VEL_MAX_DN"],
        )

    def _take_designs(self) -> None:
        """New weights are designed for in the background; what is ready is taken between two ticks."""
        changed = self.station.parameters.take_changed()
        if changed & WEIGHTS.keys():
            self._new_weights = True
            self._request_designs(self.station.profile.rest_length)
        result = self._redesigner.result()
        if result is None:
            return
        self._designing = False
        if isinstance(result, str):
            self.station.announce(Notice(WARNING, f"Weights not used: {result}"), self._heard)
            return
        before, self._designs = self._designs, dict(zip((Body.LOAD, Body.VEHICLE), result, strict=True))
        self._designed_length = self._wanted_length
        self._designs[Body.LOAD]["body"]["rest_length"] = self.station.profile.rest_length
        if self._law is not None:
            yaw = float(self._trajectory.path["yaw"][0])
            after = self._designs[self._law]
            handover.other_gains(before[self._law], after, self._memory, self._work, yaw)
            self._step = self._bound(self._law)
        if self._new_weights:
            self._new_weights = False
            self.station.announce(Notice(INFO, "New weights fly"), self._heard)
