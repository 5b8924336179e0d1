"""The laws of a vehicle under ground control: which one flies, to where, and with which gains.

Three fly it: one for the vehicle on a slack cable, one for the load once that hangs, and one for a client
that steers attitude and thrust.
"""

from __future__ import annotations

import math

import numpy as np

from controller.design.catalogue import EVEN, guided_designs
from controller.design.later import follow
from controller.feedback.assessment import Contact
from controller.ground.commands.result import INFO, WARNING, Notice
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
from controller.ground.station import Station
from controller.ground.telemetry.vehicle_state import VehicleView
from controller.law import bumpless_transfer as handover
from controller.law.allocation import allocation
from controller.law.attitude_law import attitude_law, attitude_step, set_limits
from controller.law.control_law import WORK, Law, Memory, engaged_memory
from controller.law.control_step import control_step
from controller.law.state import (
    EULER_ANGLES,
    LOAD_POSITION,
    LOAD_VELOCITY,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
    Array,
)
from controller.pilot.guided.late_gains import LateGains
from controller.pilot.guided.redesign import WEIGHTS, Redesigner
from controller.pilot.guided.stages import AT_ONCE, NEVER, Moment
from sitl_bridge.frames import Triple
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.rotors import full_thrust

IDLE_COMMAND = 0.08
"""Rotors of a vehicle that is armed on the ground, as a share of their largest speed."""
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


class GuidedLaws:
    """Trajectory, laws and gains of one vehicle; `controls` (16,) are its rotor commands, 0..1."""

    def __init__(
        self, vehicle: Vehicle, rate_hz: float, station: Station, redesigner: Redesigner, controls: Array
    ) -> None:
        self.estimate = np.zeros(18)
        """Eq. 31, that the next step flies on"""
        self._station = station
        self._vehicle = vehicle
        self._rotors = controls[: len(vehicle.rotors)]
        self._controls = controls
        self._redesigner = redesigner
        self._designed_length = self._wanted_length = vehicle.cable.rest_length
        """m, of the cable that the gains are for, or will be"""
        self._designing = self._new_weights = False
        self._designs = dict(zip((Body.LOAD, Body.VEHICLE), guided_designs(vehicle, rate_hz), strict=True))
        self._late_gains = LateGains(vehicle)
        self._late_gains.made(self._designs, self._designed_length)
        pole = motion_pole(vehicle.hover_length, vehicle.gravity)
        self._trajectory = Trajectory(1.0 / rate_hz, pole, with_the_law=True)
        weight = vehicle.gravity * (vehicle.airframe.mass + vehicle.load.mass)
        spare = THRUST_SHARE * full_thrust(vehicle.rotors) / weight - 1.0
        self._most_acceleration = max(LEAST_ACCELERATION, spare * vehicle.gravity)
        self._allocation = allocation(vehicle)
        self._work = np.zeros(1, dtype=WORK)
        self._attitude_law = attitude_law(vehicle, rate_hz)
        self._attitude_step = attitude_step.bind(
            self._attitude_law, self._allocation, self._work, self.estimate, controls
        )
        self._steered = False
        """The client steers attitude and thrust: the attitude law flies"""
        self._body: Body | None = None
        """Whose law flies; None on the ground"""
        self._target: Target | None = None
        self._memory: Memory = engaged_memory(np.zeros(3))
        self._bind(Body.VEHICLE)  # compiled code is loaded now
        self._pulling: tuple[Target, Goto] | None = None
        """A target for the load, and what the vehicle does for it while the load lies"""

    @property
    def law(self) -> Law | None:
        """The arrays of `control_step`, which goes on with the trajectory too; None: no such law flies."""
        return None if self._body is None else self._arrays

    @property
    def terms(self) -> Array | None:
        """What the last command is made of, see `terms_log.Termed`."""
        return None if self._body is None and not self._steered else self._work["terms"].reshape(-1)

    def stop(self) -> None:
        """Nothing flies."""
        self._body = None

    # The stage that flies

    def fly(self, moment: Moment) -> None:
        """Rotor commands towards the target."""
        target = self._target = moment.target
        if isinstance(target, Attitude):
            self._steer(target)
            return
        if isinstance(target, Idle | Terminate):
            self._body = None
            self._steered = False
            self._rotors[:] = IDLE_COMMAND
            return
        body = self._body_for(target, moment.contact)
        if body is not self._body:
            self._engage(body)
        if body is not target.body:
            target = self._pull(target, moment.view)
        self._trajectory.aim(target, self._limits(target, moment.view))
        self._step()

    def go_on(self) -> None:
        """One step more towards the same target, with the law that flies."""
        self._step()

    def fly_due(self) -> float:
        """While it is not the target's own law that flies."""
        target = self._target
        steady = isinstance(target, Goto | Follow | Land) and target.body is self._body
        return NEVER if steady else AT_ONCE

    def _steer(self, target: Attitude) -> None:
        """One step of the attitude law."""
        law, p = self._attitude_law, self._station.parameters
        if not self._steered:
            law["integral"] = 0.0
        self._body, self._steered = None, True
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
        if target.body is Body.VEHICLE or self._body is Body.LOAD:
            return target.body
        return Body.LOAD if contact.load_lifted else Body.VEHICLE

    def _pull(self, target: Goto | Follow | Land, view: VehicleView) -> Goto:
        """The vehicle alone rises above a load that lies, until it hangs."""
        if self._pulling is None or self._pulling[0] is not target:
            x, y, z = view.load_position
            above: Triple = (x, y, z + self._station.profile.hover_length + REACH)
            yaw = float(self._trajectory.path["yaw"][0]) if math.isnan(target.yaw) else target.yaw
            goto = Goto(Body.VEHICLE, above, yaw, PICK_UP_SPEED)
            self._pulling = (target, goto)
        return self._pulling[1]

    def _engage(self, body: Body) -> None:
        """Hand over to a law: its reference starts with the body's motion, what the rotors give goes on."""
        estimate = self.estimate
        position, velocity = (
            (LOAD_POSITION, LOAD_VELOCITY) if body is Body.LOAD else (VEHICLE_POSITION, VEHICLE_VELOCITY)
        )
        yaw = float(estimate[EULER_ANGLES][2] if self._body is None else self._trajectory.path["yaw"][0])
        memory = engaged_memory(estimate[position])
        before = self._memory if self._body is not None else None
        moves = estimate[velocity].copy()
        winch = self._station.machine.payload.winch
        if body is Body.LOAD and winch is not None:  # what the winch adds comes by `lower`
            moves[2] += winch.speed
        self._trajectory.start(estimate[position], moves, yaw)
        if before is not None and self._body is not None:
            handover.other_body(self._designs[self._body], self._designs[body], before, memory)
        if self._steered:
            handover.from_wrench(self._designs[body], self._work["achieved"][0], memory)
            self._steered = False
        self._body, self._memory = body, memory
        self._bind(body)

    def _bind(self, body: Body) -> None:
        self._arrays: Law = (
            self._designs[body],
            self._allocation,
            self._trajectory.path,
            self._memory,
            self._work,
        )
        self._step = control_step.bind(*self._arrays, self.estimate, self._controls)

    def _limits(self, target: Goto | Follow | Land, view: VehicleView) -> Limits:
        p = self._station.parameters
        total = min(p["MPC_ACC_HOR_MAX"], self._most_acceleration)
        return Limits(
            min(p["MPC_ACC_HOR"], total),
            total,
            p["MPC_XY_VEL_MAX"],
            p["MPC_Z_VEL_MAX_UP"],
            p["MPC_Z_VEL_MAX_DN"],
            self._station.machine.guidance.floor(target.body, view),
        )

    # Gains, and the cable that they are for

    def take_designs(self, moment: Moment) -> None:
        """New weights are designed for in the background; what is ready is taken between two ticks."""
        changed = self._station.parameters.take_changed()
        if changed & WEIGHTS.keys():
            self._new_weights = True
            self._request_designs(self._station.profile.rest_length)
        result = self._redesigner.result()
        if result is None:
            return
        self._designing = False
        if isinstance(result, str):
            self._station.announce(Notice(WARNING, f"Weights rejected: {result}"), moment.now)
            return
        before, self._designs = self._designs, dict(zip((Body.LOAD, Body.VEHICLE), result, strict=True))
        self._designed_length = self._wanted_length
        self._late_gains.made(self._designs, self._designed_length)
        self._designs[Body.LOAD]["body"]["rest_length"] = self._station.profile.rest_length
        if self._body is not None:
            yaw = float(self._trajectory.path["yaw"][0])
            after = self._designs[self._body]
            handover.other_gains(before[self._body], after, self._memory, self._work, yaw)
            self._bind(self._body)
        if self._new_weights:
            self._new_weights = False
            self._station.announce(Notice(INFO, "New weights in use"), moment.now)

    def act_late(self, ticks: int) -> None:
        """Commands act so many ticks late: the gains, and what is remembered of the rotors, follow."""
        self._late_gains.act_late(self._designs, ticks)
        if self._body is not None:
            follow(self._designs[self._body], self._memory)

    def designs_due(self) -> float:
        """While they are made; parameters come in datagrams, at which the station looks at once."""
        return AT_ONCE if self._designing else NEVER

    def wants_designs(self, rest_length: float) -> bool:
        """Whether gains are to be designed anew for this cable, m: from a tenth of its length on."""
        return not self._designing and abs(rest_length / self._designed_length - 1.0) > REDESIGN_SHARE

    def reeled(self, rest_length: float, change: float, speed: float, estimate: Array) -> None:
        """The cable is so long (m), by so much longer than before (m), and goes on at a speed, m/s.

        Seen from a load that sinks at the winch's rate the vehicle sinks with it, as on a cable of constant
        length; estimate: (18,), which is made so.
        """
        if change != 0.0:
            self._designs[Body.LOAD]["body"]["rest_length"] = rest_length
        hangs = self._body is Body.LOAD
        self._trajectory.lower(change if hangs else 0.0, speed if hangs else 0.0)
        if hangs:
            estimate[VEHICLE_VELOCITY.stop - 1] -= speed
        if self.wants_designs(rest_length):
            self._request_designs(rest_length)

    def _request_designs(self, rest_length: float) -> None:
        p = self._station.parameters
        self._designing, self._wanted_length = True, rest_length
        emphasis = EVEN._replace(**{field: p[name] for name, field in WEIGHTS.items()})
        self._redesigner.request(emphasis, rest_length)
