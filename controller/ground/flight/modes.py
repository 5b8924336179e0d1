"""The mode machine: requests, the vehicle's state and time in; what the law is to do out.

Disarmed, or armed on the ground, the mode is only what will happen next; in the air `guidance` gives each
mode its target. Requests are judged here, and failsafes change the mode.

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
from typing import NamedTuple

from controller.ground.commands.result import (
    EMERGENCY,
    FAILED,
    INFO,
    OK,
    UNSUPPORTED,
    WARNING,
    Notice,
    Verdict,
    deny,
    not_now,
)
from controller.ground.commands.setpoints import Offboard, Setpoint
from controller.ground.flight.guidance import Guidance, Stage
from controller.ground.flight.limits.failsafes import Failsafes, Reaction, Situation
from controller.ground.flight.limits.fence import Fence
from controller.ground.flight.limits.preconditions import arming_faults, has_settled
from controller.ground.flight.mission_flight import MissionFlight
from controller.ground.flight.motion.geometry import above, filled, hanging_load, limited_speed
from controller.ground.flight.motion.patterns import Orbit, Pattern
from controller.ground.flight.motion.setpoint_types import Attitude, Idle, Target, Terminate
from controller.ground.flight.motion.sticks import JOYSTICK, Axes, Sticks
from controller.ground.flight.payload.payload import DELIVER, Payload
from controller.ground.flight.px4_modes import BY_STICKS, Mode
from controller.ground.missions import mission_plan as plan
from controller.ground.missions.item_types import WAYPOINT
from controller.ground.missions.legs import crossed_zones
from controller.ground.missions.mission_plan import Fault, Item
from controller.ground.missions.zones import rally_points_of, zones_of
from controller.ground.parameters.protocol import Parameters
from controller.ground.telemetry.vehicle_state import Profile, VehicleView
from sitl_bridge.frames import Geodetic, Triple

_REACTION_MODES = {Reaction.HOLD: Mode.HOLD, Reaction.RETURN: Mode.RTL, Reaction.LAND: Mode.LAND}
_SEVERITY_OF_MODE = {mode: reaction for reaction, mode in _REACTION_MODES.items()}


_SAME_HEIGHT = 1.0
"""m, by which the altitude of a home may differ from the ground's without a word"""
_MOST_WARNINGS = 5
"""Of zones that one plan crosses"""
_LIFTS = 0.3
"""m, above a vehicle on the ground, from which on a set-point asks for a take-off"""


class Reposition(NamedTuple):
    """Where to go in HOLD, m and rad ENU; NaN: as it is."""

    of_load: bool
    position: Triple
    yaw: float
    speed: float
    """m/s"""


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
        self._guidance = Guidance(profile, parameters, self.mission, self)
        self._armed_at = 0.0
        self._armed_at_view = 0.0
        """The same on the plant's clock"""

    # What others read

    @property
    def stage(self) -> Stage:
        """How far the vehicle is off the ground."""
        return self._guidance.stage

    @property
    def home(self) -> Triple | None:
        """m ENU, where the vehicle was armed last, on the ground if it has one; disarmed, where it is."""
        return self._guidance.home

    @property
    def flying(self) -> bool:
        """Whether the vehicle is off the ground, or on its way."""
        return self.armed and self.stage is not Stage.GROUND

    @property
    def _flies_soon(self) -> bool:
        """Whether the vehicle is off the ground, or will be at the next look."""
        return self.flying or (self.armed and self.mode is Mode.TAKEOFF)

    @property
    def fence(self) -> Fence | None:
        """The limits around home, once there is one."""
        with_load = self.view is None or self.view.load_attached
        return None if self.home is None else self._guidance.fence(with_load)

    def home_geodetic(self) -> Geodetic:
        """Home's latitude, longitude and altitude; the origin's until there is one."""
        return self._guidance.home_geodetic()

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
        self._armed_at, self._armed_at_view = now, view.time
        self.failsafes.reset()
        self._guidance.begin(view)

    def set_home_to(self, place: Triple) -> Verdict:
        """Home, to which Return goes, is elsewhere (m ENU); its height stays the ground's."""
        if self.home is None:
            return not_now("Home denied: no position yet; start the plant")
        if not math.isnan(place[2]) and abs(place[2] - self.home[2]) > _SAME_HEIGHT:
            self.say(INFO, "Home's altitude stays that of the ground where the vehicle was armed")
        self._guidance.set_home_to(place[0], place[1])
        return OK

    def restart(self) -> None:
        """As after a reboot: parameters and mission stay, all else is as at the start. Disarmed only."""
        self.offboard, self.sticks = Offboard(), Sticks()
        self.failsafes.reset()
        self.terminated = False
        self.mode = Mode.HOLD
        self.target = Idle(False)
        before = self._guidance
        self._guidance = Guidance(self.profile, self.parameters, self.mission, self)
        self._guidance.zones, self._guidance.rally_points = before.zones, before.rally_points
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

    def set_mode(self, mode: Mode, now: float) -> Verdict:
        """Change the mode, now if flying, else as what will happen after arming."""
        if self.terminated:
            return deny("Mode denied: the flight was terminated; disarm first")
        if mode is Mode.MISSION and not self.mission.items:
            return deny("Mission denied: there is none; upload one first")
        if mode is Mode.MISSION and (fault := self.check_plan(self.mission.items)) is not None:
            return deny(f"Mission denied: {fault.text}")
        if mode is Mode.OFFBOARD and not self._setpoint_fresh(now):
            return not_now("Offboard denied: no set-points; send them at 2 Hz or more first")
        if mode in BY_STICKS and not self._sticks_fresh(now):
            return not_now(f"{mode.title} denied: no sticks; send MANUAL_CONTROL first")
        if mode is Mode.LAND and not self.profile.has_ground:
            return deny("Landing denied: this vehicle has no ground under it; use Hold")
        if mode is Mode.TAKEOFF:
            return self.takeoff(math.nan)
        self.enter(mode)
        return OK

    def takeoff(self, altitude: float) -> Verdict:
        """Take off, now or when armed, to a height of the vehicle, m ENU; NaN: by MIS_TAKEOFF_ALT."""
        if self.terminated:
            return deny("Take-off denied: the flight was terminated; disarm first")
        if self.flying and self.stage is not Stage.ASCENT and not self._guidance.load_is_down:
            return not_now("Take-off denied: already flying; send a point to go to instead")
        fence = self.fence
        if fence is None or self.view is None:
            return not_now("Take-off denied: no position yet; start the plant")
        if math.isinf(altitude):
            return deny("Take-off denied: the altitude is no number")
        if not math.isnan(altitude) and altitude <= fence.home[2]:
            below = fence.home[2] - altitude
            self.say(
                WARNING, f"Take-off altitude is {below:.1f} m below home (it is above mean sea level): raised"
            )
        height = self._guidance.height_of_takeoff(altitude, self.view)
        fault = fence.outside((fence.home[0], fence.home[1], height))
        if fault:
            return deny(f"Take-off denied: {fault}")
        self.enter(Mode.TAKEOFF)
        self._guidance.ask_takeoff_height(altitude, self.view)
        return OK

    def reposition(self, where: Reposition, change_mode: bool) -> Verdict:
        """Go to a point and hold there; what is NaN stays as it is."""
        view = self.view
        if self.terminated:
            return deny("Reposition denied: the flight was terminated; disarm first")
        if view is None or not self._flies_soon:
            return not_now("Reposition denied: not flying; take off first")
        if not change_mode and self.mode is not Mode.HOLD:
            return not_now(f"Reposition denied: in {self.mode.title}; ask for a change of mode (param2 = 1)")
        if any(math.isinf(x) for x in (*where.position, where.yaw)):
            return deny("Reposition denied: position or heading is infinite")
        here = hanging_load(view, self.profile) if where.of_load else view.position
        vehicle = self._vehicle_point(filled(where.position, here), where.of_load)
        stays = all(math.isnan(x) for x in where.position)
        fence = self.fence
        if fence is not None and not stays:
            if fault := fence.outside(vehicle):
                return deny(f"Reposition denied: {fault}")
            if fault := fence.too_low(vehicle):
                self.say(WARNING, f"Reposition limited: {fault}")
                vehicle = fence.raised(vehicle)
        if self.stage is Stage.GROUND:
            self._guidance.take_off(view)  # before the mode changes: it is what the take-off was asked for
        self.enter(Mode.HOLD)
        speed = limited_speed(where.speed, self.parameters)
        self._guidance.go_to(None if stays else vehicle, where.yaw, speed, view)
        if self.stage is not Stage.FLYING and not stays:
            self.say(INFO, "Reposition accepted: after take-off")
        return OK

    def fly_pattern(self, pattern: Pattern) -> Verdict:
        """Fly an orbit, or a figure of eight in Hold, when the load hangs clear of the ground."""
        name = "Orbit" if isinstance(pattern, Orbit) else "Figure eight"
        fence = self.fence
        if self.terminated:
            return deny(f"{name} denied: the flight was terminated; disarm first")
        if fence is None or self.view is None or not self._flies_soon:
            return not_now(f"{name} denied: not flying; take off first")
        for point in pattern.extent():
            if fault := fence.outside(point):
                return deny(f"{name} denied: {fault}")
        if fault := fence.too_low(pattern.centre):
            self.say(WARNING, f"{name} limited: {fault}")
            pattern.centre = fence.raised(pattern.centre)
        if self.stage is Stage.GROUND:
            self._guidance.take_off(self.view)
        self.enter(Mode.ORBIT if isinstance(pattern, Orbit) else Mode.HOLD)
        self._guidance.pattern = pattern
        return OK

    def grip(self, action: int) -> Verdict:
        """Release (0) or grab (1) the load; done when the outputs are live and the hook is within reach."""
        if self.payload.gripper is None:
            return Verdict(UNSUPPORTED, "Gripper denied: this vehicle has none; see [gripper] in its file")
        self.payload.gripper.act(action)
        return OK

    def reel(self, action: float, length: float, rate: float) -> Verdict:
        """DO_WINCH; length (m) and rate (m/s) pay out. A delivery begins in Hold."""
        if action == DELIVER and self.payload.delivers:
            if self.payload.delivering:
                return OK
            if self.stage is not Stage.FLYING or self.view is None:
                return not_now("Delivery denied: not flying with the load; take off first")
            fault = self.payload.delivery_fault(self.view)
            if fault:
                return deny(f"Delivery denied: {fault}")
            self.enter(Mode.HOLD)
        return self.payload.work_winch(action, length, rate, self.view)

    def reeled(self, change: float) -> None:
        """The winch has made the cable longer by so much, m: what was said of the load is still meant."""
        self.profile.rest_length += change
        self.profile.hover_length += change
        self._guidance.lengthened(change)

    @property
    def pattern(self) -> Pattern | None:
        """The orbit or figure of eight that is flown, or will be after the take-off."""
        return self._guidance.pattern

    def hear_target(self, position: Triple, velocity: Triple) -> None:
        """Where somebody is who may be followed, m and m/s ENU."""
        if self.view is not None:
            self._guidance.followed.hear(position, velocity, self.view.time)

    def change_speed(self, speed: float) -> Verdict:
        """Largest horizontal speed until the mode changes, m/s; -1: the default."""
        largest = self.parameters["MPC_XY_VEL_MAX"]
        if speed != -1 and not 0 < speed <= largest:
            return deny(
                f"Speed {speed:g} m/s denied: use up to {largest:g} (MPC_XY_VEL_MAX), or -1 for the default"
            )
        self._guidance.speed = self.mission.speed = math.nan if speed == -1 else speed
        return OK

    def offer(self, setpoint: Setpoint, sender: object, now: float) -> str:
        """An offboard set-point; returns why it is not taken, or an empty string."""
        fence = self.fence
        if fence is None or self.view is None:
            return "Set-point denied: no position yet; start the plant"
        here = hanging_load(self.view, self.profile) if setpoint.of_load else self.view.position
        point = self._vehicle_point(filled(setpoint.position, here), setpoint.of_load)
        asked = any(not math.isnan(x) for x in setpoint.position)
        fault = fence.outside(point) if asked else ""
        if fault:
            return f"Set-point denied: {fault}"
        return self.offboard.offer(setpoint, sender, now, self.parameters["COM_OF_LOSS_T"])

    def offer_attitude(self, setpoint: Attitude, sender: object, now: float) -> str:
        """An offboard set-point of attitude or rates; returns why it is not taken, or an empty string."""
        return self.offboard.offer(setpoint, sender, now, self.parameters["COM_OF_LOSS_T"])

    def move_sticks(self, axes: Axes, sender: object, now: float) -> str:
        """Positions of a pilot's sticks; returns why they are not taken, or an empty string."""
        source = self.parameters.integer("COM_RC_IN_MODE")
        if source not in JOYSTICK:
            return f"Sticks ignored: COM_RC_IN_MODE is {source}; set it to 1"
        return self.sticks.hear(axes, sender, now, self.parameters["COM_RC_LOSS_T"])

    def check_plan(self, items: tuple[Item, ...]) -> Fault | None:
        """The first fault of a plan."""
        return plan.check(items, self.profile, self.home_geodetic(), self._guidance.fence())

    def accept_plan(self, items: tuple[Item, ...]) -> Fault | None:
        """Take a plan, or say why not."""
        fault = self.check_plan(items)
        if fault is not None:
            return fault
        for text in plan.remarks(items, self.profile, self.home_geodetic(), self._guidance.fence()):
            self.say(INFO, text)
        self._warn_of_zones(items)
        self.mission.replace(items)
        if self.armed and self.mode is Mode.MISSION:
            if items:
                self.mission.start()
                self.say(INFO, "Mission replaced: flying the new one from its beginning")
            else:
                self.say(INFO, "Mission cleared in flight; holding")
                self.enter(Mode.HOLD)
        return None

    def accept_fence(self, items: tuple[Item, ...]) -> Fault | None:
        """Take a geofence, or say why not."""
        zones = zones_of(items, self.profile.origin)
        if isinstance(zones, Fault):
            return zones
        self._guidance.zones = zones
        self._warn_of_zones(self.mission.items)
        return None

    def _warn_of_zones(self, items: tuple[Item, ...]) -> None:
        """Say which ways of a plan cross an exclusion zone."""
        guidance, home = self._guidance, self.home_geodetic()
        texts = crossed_zones(items, self.profile.origin, home, guidance.fence(), guidance.zones)
        for text in texts[:_MOST_WARNINGS]:
            self.say(WARNING, text)

    def accept_rally(self, items: tuple[Item, ...]) -> Fault | None:
        """Take rally points, or say why not."""
        points = rally_points_of(items, self.profile.origin)
        if isinstance(points, Fault):
            return points
        self._guidance.rally_points = points
        return None

    def set_current_item(self, seq: int, reset: bool = False) -> Verdict:
        """Go on with another item of the plan, -1: the current one; `reset`: every jump counts afresh."""
        if reset and 0 <= max(seq, 0) < len(self.mission.items):
            self.mission.restart(self.mission.current)
        fault = "" if seq == -1 and self.mission.items else self.mission.jump(seq)
        return Verdict(FAILED, fault) if fault else OK

    def go_to_item(self, item: Item, only_height: bool) -> Fault | None:
        """Fly to a way-point that is no part of a plan, or to its height only."""
        fault = plan.check((item,), self.profile, self.home_geodetic(), self._guidance.fence())
        if fault is not None:
            return Fault(fault.result, f"Reposition denied: {fault.text}")
        if item.command != WAYPOINT:
            return Fault(2, f"Reposition denied: command {item.command} is no way-point")  # UNSUPPORTED
        x, y, z = plan.place(item, self.profile.origin, self.home_geodetic())
        point = (math.nan, math.nan, z) if only_height else (x, y, z)
        verdict = self.reposition(Reposition(False, point, math.nan, math.nan), True)
        return None if verdict.ok else Fault(14, verdict.text)  # MAV_MISSION_DENIED

    # Time

    def update(self, view: VehicleView, now: float, last_station: float | None) -> Target:
        """What the law is to do now. The same object as before if nothing has changed."""
        self.view = view
        if not self.armed:
            # Clients arm as soon as there is a home: there is none before that would be accepted.
            known = self.home is not None or has_settled(view, self.parameters)
            if known and view.health.position and view.in_reach and view.hil_age < math.inf:
                self._guidance.set_home(view)
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
            self.mode, self._setpoint_fresh(now), self.sticks.time, last_station, self._armed_at
        )
        fence = self._guidance.fence(view.load_attached)
        for trigger in self.failsafes.check(view, now, situation, self.parameters, fence):
            self.say(trigger.severity, trigger.text)
            if trigger.reaction is Reaction.TERMINATE:
                self._terminate("")
            elif trigger.to_sticks is not None and self._sticks_fresh(now):
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
        wanted = self.parameters.integer("COM_RC_OVERRIDE") & bit and self._sticks_fresh(now)
        in_the_air = self.stage in (Stage.FLYING, Stage.DESCENT) and not self._guidance.load_is_down
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
        target = self._guidance.target(view, asked, self.target)
        refusals, self.mission.refusals = self.mission.refusals, []
        for text in refusals:
            self.say(WARNING, text)
        return target

    def _on_ground(self, view: VehicleView, now: float) -> None:
        if self.mode in (Mode.TAKEOFF, Mode.MISSION) or (self._setpoint_lifts(view, now)):
            self._guidance.take_off(view)
            return
        steered = self.mode is Mode.OFFBOARD and self._setpoint_fresh(now)
        if steered and self._guidance.lifts(self.offboard.latest):
            self._guidance.stage = Stage.FLYING
            return
        landed = self._guidance.landed_at >= self._armed_at_view
        name = "COM_DISARM_LAND" if landed else "COM_DISARM_PRFLT"
        since = self._guidance.landed_at if landed else self._armed_at_view
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
        self._guidance.forget_destination()
        self.sticks.rest()
        if mode in BY_STICKS and self.view is not None:
            self.sticks.start(self.view)
        again = mode is self.mode and mode not in (Mode.HOLD, Mode.RTL)
        self.set_mode_to(mode)
        if mode not in (Mode.LAND, Mode.RTL):
            self._guidance.break_off_landing()
        if self.view is not None and self.armed and self.stage is Stage.FLYING and not again:
            self._guidance.hold_here(self.view)
            self._guidance.start(mode)

    def set_mode_to(self, mode: Mode) -> None:
        """Have another mode, and say so."""
        if mode is not self.mode:
            self._guidance.takeoff_height = math.nan  # it was asked of the mode that is left
            self.mode = mode
            self.say(INFO, f"Mode: {mode.title}")

    def _vehicle_point(self, point: Triple, of_load: bool) -> Triple:
        return above(point, self.profile.hover_length) if of_load else point

    def _setpoint_fresh(self, now: float) -> bool:
        return self.offboard.fresh(now, self.parameters["COM_OF_LOSS_T"])

    def _setpoint_lifts(self, view: VehicleView, now: float) -> bool:
        """Whether pilot or offboard client want the vehicle off the ground, by the axes that PX4 looks at."""
        if self.mode in BY_STICKS:
            return self._sticks_fresh(now) and self.sticks.lifts()
        asked = self.offboard.latest
        if self.mode is not Mode.OFFBOARD or not self._setpoint_fresh(now):
            return False
        if asked is None or isinstance(asked, Attitude):
            return False
        height = self._vehicle_point(asked.position, asked.of_load)[2]
        return height > view.position[2] + _LIFTS or asked.velocity[2] > 0.0 or asked.acceleration[2] > 0.0

    def _sticks_fresh(self, now: float) -> bool:
        return self.sticks.fresh(now, self.parameters["COM_RC_LOSS_T"])

    def _disarm(self, text: str) -> None:
        self.armed = False
        self._guidance.end()
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
