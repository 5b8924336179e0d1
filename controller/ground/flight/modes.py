"""The mode machine: the vehicle's state and time in; what the law is to do out.

Disarmed, or armed on the ground, the mode is only what will happen next; in the air `guidance` gives each
mode its target. Arming, failsafes and the change of modes are here. `client_requests`, `plans` and `steering`
judge what clients ask for.

    stage    | goes on to | when
    ---------+------------+----------------------------------------------------------------------
    GROUND   | ASCENT     | armed, and TAKEOFF, MISSION, a set-point or a throttle that asks for height
             | FLYING     | armed, and an attitude set-point in OFFBOARD with thrust to fly
    ASCENT   | FLYING     | at its height in TAKEOFF; in any other mode when the load hangs clear
             | DESCENT    | LAND
    FLYING   | DESCENT    | LAND, or RTL above home, or a mission's landing
             | GROUND     | an attitude set-point without thrust, on the ground
    DESCENT  | GROUND     | the vehicle stands: landed
             | FLYING     | any other mode, while the load hangs
             | ASCENT     | any other mode, once the load lies
    any      | GROUND     | disarmed

    mode               | entered by                        | left by itself for
    -------------------+-----------------------------------+-------------------------------------
    TAKEOFF            | request                           | HOLD, at its height
    HOLD               | request, point, failsafe          | POSITION, when a pilot's stick moves
    MISSION            | request, with a plan              | HOLD, RTL, LAND, as the plan ends
    RTL, LAND          | request, failsafe                 | HOLD, when landed
    OFFBOARD           | request, with fresh set-points    | by COM_OBL_RC_ACT, without set-points
    POSITION, ALTITUDE | request or stick, with fresh sticks | by NAV_RCL_ACT, without sticks
    ORBIT              | DO_ORBIT or request               | HOLD, after the turns asked for
    FOLLOW_TARGET      | request                           | (stands without a target)
    TERMINATION        | command, failsafe                 | HOLD, when disarmed
"""

from __future__ import annotations

import math

from controller.ground.commands.result import (
    EMERGENCY,
    INFO,
    OK,
    WARNING,
    Notice,
    Verdict,
    deny,
    not_now,
)
from controller.ground.commands.setpoints import Offboard
from controller.ground.flight import steering
from controller.ground.flight.guidance import Guidance, Stage
from controller.ground.flight.limits.failsafes import Failsafes, Reaction, Situation
from controller.ground.flight.limits.fence import Fence
from controller.ground.flight.limits.preconditions import arming_faults, has_settled
from controller.ground.flight.mission_flight import MissionFlight
from controller.ground.flight.motion.geometry import above
from controller.ground.flight.motion.patterns import Pattern
from controller.ground.flight.motion.setpoint_types import Idle, Target, Terminate
from controller.ground.flight.motion.sticks import Sticks
from controller.ground.flight.payload.payload import Payload
from controller.ground.flight.px4_modes import BY_STICKS, Mode
from controller.ground.parameters.protocol import Parameters
from controller.ground.telemetry.vehicle_state import Profile, VehicleView
from sitl_bridge.frames import Geodetic, Triple

_REACTION_MODES = {Reaction.HOLD: Mode.HOLD, Reaction.RETURN: Mode.RTL, Reaction.LAND: Mode.LAND}
_SEVERITY_OF_MODE = {mode: reaction for reaction, mode in _REACTION_MODES.items()}


_SAME_HEIGHT = 1.0
"""m, by which the altitude of a home may differ from the ground's without a word"""


class Machine:
    """The state of one vehicle that ground control can change."""

    def __init__(self, profile: Profile, parameters: Parameters) -> None:
        self.profile = profile
        self.parameters = parameters
        self.armed = False
        self.terminated = False
        self.mode = Mode.HOLD
        self.offboard = Offboard()
        self.sticks = Sticks()
        self.payload = Payload(profile)
        self.mission = MissionFlight(self.payload)
        self.failsafes = Failsafes()
        self.target: Target = Idle(False)
        self.notices: list[Notice] = []
        self.view: VehicleView | None = None
        self.guidance = Guidance(profile, parameters, self.mission, self)
        self.plan_ids = (0, 0, 0)
        """Of mission, geofence and rally points; 0: there is none"""
        self._armed_at = 0.0
        self.armed_at = 0.0
        """The same on the plant's clock"""
        self.flights = 0
        """How often it was armed"""

    # What others read

    @property
    def stage(self) -> Stage:
        """How far the vehicle is off the ground."""
        return self.guidance.stage

    @property
    def home(self) -> Triple | None:
        """m ENU, where the vehicle was armed last, on the ground if it has one; disarmed, where it is."""
        return self.guidance.home.position

    @property
    def flying(self) -> bool:
        """Whether the vehicle is off the ground, or on its way."""
        return self.armed and self.stage is not Stage.GROUND

    @property
    def flies_soon(self) -> bool:
        """Whether the vehicle is off the ground, or will be at the next look."""
        return self.flying or (self.armed and self.mode is Mode.TAKEOFF)

    @property
    def fence(self) -> Fence | None:
        """The limits around home, once there is one."""
        with_load = self.view is None or self.view.load_attached
        return None if self.home is None else self.guidance.fence(with_load)

    def home_geodetic(self) -> Geodetic:
        """Home's latitude, longitude and altitude; the origin's until there is one."""
        return self.guidance.home.geodetic()

    def arming_faults(self) -> list[str]:
        """Why the vehicle cannot be armed now."""
        if self.terminated:
            return ["the flight was terminated; disarm first"]
        return arming_faults(self.view, self.parameters, self.fence)

    # Requests

    def arm(self, now: float) -> Verdict:
        """Arm, if the preconditions hold."""
        if self.armed and not self.terminated:
            return OK
        faults = self.arming_faults()
        if self.mode is Mode.MISSION and not self.mission.items:
            faults = [*faults, "there is no mission; upload one, or choose another mode"]
        if faults or self.view is None:
            return not_now("Arming denied: " + "; ".join(faults))
        self._begin_flight(self.view, now)
        self.say(INFO, "Armed")
        return OK

    def resume(self, view: VehicleView, now: float) -> None:
        """Take over a vehicle that is in the air (the controller was started again in flight), and hold."""
        self.view = view
        self._begin_flight(view, now)
        self.say(WARNING, "Started in flight: holding")

    def _begin_flight(self, view: VehicleView, now: float) -> None:
        self.armed = True
        self._armed_at, self.armed_at = now, view.time
        self.flights += 1
        self.failsafes.reset()
        self.guidance.begin(view)

    def set_home_to(self, place: Triple) -> Verdict:
        """Home, to which Return goes, is elsewhere (m ENU); its height stays the ground's."""
        if self.home is None:
            return not_now("Home denied: no position yet; start the plant")
        if not math.isnan(place[2]) and abs(place[2] - self.home[2]) > _SAME_HEIGHT:
            self.say(INFO, "Home's altitude stays that of the ground where the vehicle was armed")
        self.guidance.home.move_to(place[0], place[1])
        return OK

    def restart(self) -> None:
        """As after a reboot: parameters and mission stay, all else is as at the start. Disarmed only."""
        self.offboard, self.sticks = Offboard(), Sticks()
        self.failsafes.reset()
        self.terminated = False
        self.mode = Mode.HOLD
        self.target = Idle(False)
        before = self.guidance
        self.guidance = Guidance(self.profile, self.parameters, self.mission, self)
        self.guidance.zones = before.zones
        self.guidance.in_flight.rally_points = before.in_flight.rally_points
        self.mission.replace(self.mission.items)
        self.say(INFO, "Rebooted")

    def disarm(self, force: bool) -> Verdict:
        """Disarm: on the ground, or anywhere by force."""
        if self.armed and self.flying and not force and not self.terminated and self.profile.has_ground:
            return deny("Disarming denied: in flight; land first, or force it with param2 = 21196")
        if self.armed:
            self._disarm("Disarmed" if not self.flying else "Disarmed by force: rotors stopped")
        self.terminated = False
        return OK

    def terminate(self) -> Verdict:
        """Stop the rotors for good."""
        if not self.armed:
            return deny("Termination denied: not armed")
        self._terminate("Flight terminated: rotors stopped")
        return OK

    def reeled(self, change: float) -> None:
        """The winch has made the cable longer by so much, m: what was said of the load is still meant."""
        self.profile.rest_length += change
        self.profile.hover_length += change
        self.guidance.hover.lengthened(change)

    @property
    def pattern(self) -> Pattern | None:
        """The orbit or figure of eight that is flown, or will be after the take-off."""
        return self.guidance.in_flight.pattern

    # Time

    def update(self, view: VehicleView, now: float, last_station: float | None) -> Target:
        """What the law is to do now. The same object as before if nothing has changed."""
        self.view = view
        if not self.armed:
            # Clients arm as soon as there is a home: there is none before that would be accepted.
            known = self.home is not None or has_settled(view, self.parameters)
            if known and view.health.position and view.in_reach and view.hil_age < math.inf:
                self.guidance.home.set_here(view)
            target: Target = Idle(False)
        else:
            self._react(view, now, last_station)
            lost = "hil" in self.failsafes.active
            target = self.target if lost and not self.terminated and self.armed else self._step(view, now)
        if target != self.target and not _same(target, self.target):
            self.target = target
        return self.target

    def _react(self, view: VehicleView, now: float, last_station: float | None) -> None:
        if self.stage is Stage.GROUND or self.terminated or self.home is None:
            return
        self._let_sticks_take_over(now)
        situation = Situation(
            self.mode, steering.setpoint_fresh(self, now), self.sticks.time, last_station, self._armed_at
        )
        fence = self.guidance.fence_with_way(view, self.target)
        for trigger in self.failsafes.check(view, now, situation, self.parameters, fence):
            self.say(trigger.severity, trigger.text)
            if trigger.reaction is Reaction.TERMINATE:
                self._terminate("")
            elif trigger.to_sticks is not None and steering.sticks_fresh(self, now):
                self.enter(trigger.to_sticks)
            elif trigger.reaction is Reaction.DISARM:
                self._disarm("Disarmed by a failsafe: rotors stopped")
                return
            elif trigger.reaction > _SEVERITY_OF_MODE.get(self.mode, Reaction.NONE):
                ground = self.profile.has_ground or trigger.reaction is not Reaction.LAND
                self.enter(_REACTION_MODES[trigger.reaction] if ground else Mode.HOLD)

    def _let_sticks_take_over(self, now: float) -> None:
        """Sticks that move end an automatic mode, as COM_RC_OVERRIDE has it."""
        bit = 2 if self.mode is Mode.OFFBOARD else 1
        wanted = self.parameters.integer("COM_RC_OVERRIDE") & bit and steering.sticks_fresh(self, now)
        in_the_air = self.stage in (Stage.FLYING, Stage.DESCENT) and not self.guidance.load_is_down
        if not wanted or self.mode in BY_STICKS or not in_the_air:
            return
        if self.sticks.moved(self.parameters["COM_RC_STICK_OV"] / 100.0):
            self.say(INFO, "Pilot took over by sticks")
            self.enter(Mode.POSITION)

    def _step(self, view: VehicleView, now: float) -> Target:
        if self.terminated:
            return Terminate()
        if self.stage is Stage.GROUND:
            self._on_ground(view, now)
        if not self.armed:
            return Idle(False)
        if self.stage is Stage.GROUND:
            return Idle(True)
        if text := self.payload.update(view):
            self.say(INFO, text)
        asked = self.offboard.latest
        if self.mode in BY_STICKS and self.stage is Stage.FLYING:
            asked = self.sticks.setpoint(view, self.parameters, self.mode is Mode.POSITION)
        target = self.guidance.target(view, asked, self.target)
        refusals, self.mission.refusals = self.mission.refusals, []
        for text in refusals:
            self.say(WARNING, text)
        return target

    def _on_ground(self, view: VehicleView, now: float) -> None:
        if self.mode in (Mode.TAKEOFF, Mode.MISSION) or (steering.setpoint_lifts(self, view, now)):
            self.guidance.take_off(view)
            return
        steered = self.mode is Mode.OFFBOARD and steering.setpoint_fresh(self, now)
        if steered and self.guidance.lifts(self.offboard.latest):
            self.guidance.stage = Stage.FLYING
            return
        landed = self.guidance.landed_at >= self.armed_at
        name = "COM_DISARM_LAND" if landed else "COM_DISARM_PRFLT"
        since = self.guidance.landed_at if landed else self.armed_at
        limit = self.parameters[name]
        if 0 <= limit < view.time - since:
            reason = "landed" if landed else f"no take-off within {limit:g} s ({name})"
            self._disarm(f"Disarmed: {reason}")

    # The mode

    def enter(self, mode: Mode) -> None:
        """Change the mode; in flight it begins now."""
        if self.mode is Mode.MISSION and mode is not Mode.MISSION:
            self.mission.pause()
        if self.payload.break_off():
            self.say(INFO, "Delivery broken off: reeling in")
        self.guidance.forget_destination()
        self.sticks.rest()
        if mode in BY_STICKS and self.view is not None:
            self.sticks.start(self.view)
        again = mode is self.mode and mode not in (Mode.HOLD, Mode.RTL)
        self.set_mode_to(mode)
        if mode not in (Mode.LAND, Mode.RTL):
            self.guidance.break_off_landing()
        if self.view is not None and self.armed and self.stage is Stage.FLYING and not again:
            self.guidance.in_flight.hold_here(self.view)
            self.guidance.in_flight.start(mode)

    def set_mode_to(self, mode: Mode) -> None:
        """Have another mode, and say so."""
        if mode is not self.mode:
            self.guidance.takeoff_height = math.nan  # it was asked of the mode that is left
            self.mode = mode
            self.say(INFO, f"Mode: {mode.title}")

    def vehicle_point(self, point: Triple, of_load: bool) -> Triple:
        return above(point, self.profile.hover_length) if of_load else point

    def _disarm(self, text: str) -> None:
        self.armed = False
        self.guidance.end()
        self.payload.stop_delivery()
        self.mission.pause()
        self.failsafes.reset()
        self.mode = Mode.HOLD
        self.say(INFO, text)

    def _terminate(self, text: str) -> None:
        self.terminated = True
        self.mode = Mode.TERMINATION
        self.mission.pause()
        if text:
            self.say(EMERGENCY, text)

    def say(self, severity: int, text: str) -> None:
        """A STATUSTEXT to everybody."""
        self.notices.append(Notice(severity, text))


def _same(a: Target, b: Target) -> bool:
    """Equal, a NaN counting as equal to a NaN."""
    return type(a) is type(b) and repr(a) == repr(b)
