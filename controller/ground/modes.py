"""The mode machine: requests, the vehicle's state and time in; what the law is to do out.

Disarmed, or armed on the ground, the mode is only what will happen next. In the air each mode gives a
target. Points that clients ask for are the vehicle's unless addressed to the load; what is controlled in
flight is the load, one cable length below.
"""

from __future__ import annotations

import math
from enum import Enum, auto
from typing import NamedTuple

from controller.ground import plan
from controller.ground.ascent import Ascent
from controller.ground.descent import Descent
from controller.ground.failsafes import Failsafes, Reaction, Situation
from controller.ground.fence import Fence, fence_around
from controller.ground.mission_flight import MissionFlight, Then
from controller.ground.parameters import Parameters
from controller.ground.plan import Fault, Item
from controller.ground.preconditions import arming_faults
from controller.ground.px4_modes import Mode
from controller.ground.setpoints import Offboard, Setpoint
from controller.ground.targets import Body, Follow, Goto, Idle, Target, Terminate
from controller.ground.verdict import EMERGENCY, INFO, OK, WARNING, Notice, Verdict, deny, not_now
from controller.ground.view import Profile, VehicleView
from controller.trajectory import stopping_distance
from sitl_bridge.frames import Geodetic, Triple, euler_from_quaternion

GRAVITY = 9.81
_REACTION_MODES = {Reaction.HOLD: Mode.HOLD, Reaction.RETURN: Mode.RTL, Reaction.LAND: Mode.LAND}
_SEVERITY_OF_MODE = {mode: reaction for reaction, mode in _REACTION_MODES.items()}
_NEAR = 0.5
"""m, near enough to the place above home to begin the landing"""


class Stage(Enum):
    """How far the vehicle is off the ground."""

    GROUND = auto()
    ASCENT = auto()
    FLYING = auto()
    DESCENT = auto()


class Reposition(NamedTuple):
    """Where to go in HOLD, m and rad ENU; NaN: as it is."""

    of_load: bool
    position: Triple
    yaw: float
    speed: float
    """m/s"""


class _Return(Enum):
    CLIMB = auto()
    CRUISE = auto()
    WAIT = auto()


class Machine:
    """The state of one vehicle that ground control can change."""

    def __init__(self, profile: Profile, parameters: Parameters) -> None:
        self.profile = profile
        self.parameters = parameters
        self.armed = False
        self.terminated = False
        self.mode = Mode.HOLD
        self.stage = Stage.GROUND
        self.home: Triple | None = None
        """m ENU, where the vehicle stood when it was armed last"""
        self.offboard = Offboard()
        self.mission = MissionFlight()
        self.failsafes = Failsafes()
        self.target: Target = Idle(False)
        self.notices: list[Notice] = []
        self.view: VehicleView | None = None
        self._home_load: Triple = (0.0, 0.0, 0.0)
        self._armed_at = 0.0
        self._ready_since = 0.0
        self._landed = False
        self._takeoff_height = math.nan
        self._ascent: Ascent | None = None
        self._descent: Descent | None = None
        self._return = _Return.CLIMB
        self._since = 0.0
        self._point: Triple = (0.0, 0.0, 0.0)
        """m, of the controlled body in HOLD and while waiting"""
        self._yaw = 0.0
        self._speed = math.nan

    # What others read

    @property
    def flying(self) -> bool:
        """Whether the vehicle is off the ground, or on its way."""
        return self.armed and self.stage is not Stage.GROUND

    @property
    def fence(self) -> Fence | None:
        """The limits around home, once there is one."""
        with_load = self.view is None or self.view.load_attached
        return (
            None if self.home is None else fence_around(self.home, self.parameters, self.profile, with_load)
        )

    def home_geodetic(self) -> Geodetic:
        """Home's latitude, longitude and altitude; the origin's until there is one."""
        return self.profile.origin.geodetic(self.home or (0.0, 0.0, 0.0))

    def arming_faults(self) -> list[str]:
        """Why the vehicle cannot be armed now."""
        if self.terminated:
            return ["the flight was terminated; disarm first"]
        return arming_faults(self.view, self.parameters, self.fence)

    # Requests

    def arm(self, now: float) -> Verdict:
        """Arm, if the preconditions hold."""
        if self.armed:
            return OK
        faults = self.arming_faults()
        if faults or self.view is None:
            return not_now("Arming refused: " + "; ".join(faults))
        self._begin_flight(self.view, now)
        self._say(INFO, "Armed")
        return OK

    def resume(self, view: VehicleView, now: float) -> None:
        """Take over a vehicle that is in the air (the controller was started again in flight), and hold."""
        self.view = view
        self._begin_flight(view, now)
        if self.profile.has_ground:
            # Where it was armed is not known; the ground is where the world's origin is.
            self.home = self._home_load = (view.position[0], view.position[1], 0.0)
        self._say(WARNING, "Started in flight: holding")

    def _begin_flight(self, view: VehicleView, now: float) -> None:
        self.armed = True
        self._armed_at = now
        self._ready_since = view.time
        self._landed = False
        self.failsafes.reset()
        self._set_home(view)
        airborne = not view.vehicle_on_ground
        self.stage = Stage.FLYING if airborne else Stage.GROUND
        if airborne:
            self._hold_here(view)

    def disarm(self, force: bool) -> Verdict:
        """Disarm: on the ground, or anywhere by force."""
        if self.armed and self.flying and not force and not self.terminated and self.profile.has_ground:
            return deny("Disarming refused: in flight; land first, or force it with param2 = 21196")
        if self.armed:
            self._disarm("Disarmed" if not self.flying else "Disarmed by force: rotors stopped")
        self.terminated = False
        return OK

    def terminate(self) -> Verdict:
        """Stop the rotors for good."""
        if not self.armed:
            return deny("Termination refused: not armed")
        self._terminate("Flight terminated: rotors stopped")
        return OK

    def set_mode(self, mode: Mode, now: float) -> Verdict:
        """Change the mode, now if flying, else as what will happen after arming."""
        if self.terminated:
            return deny("Mode refused: the flight was terminated; disarm first")
        if mode is Mode.MISSION and not self.mission.items:
            return deny("Mission refused: there is none; upload one first")
        if mode is Mode.MISSION and (fault := self.check_plan(self.mission.items)) is not None:
            return deny(f"Mission refused: {fault.text}")
        if mode is Mode.OFFBOARD and not self._setpoint_fresh(now):
            return not_now("Offboard refused: no set-points; send them at 2 Hz or more first")
        if mode is Mode.LAND and not self.profile.has_ground:
            return deny("Landing refused: this vehicle has no ground under it; use Hold")
        if mode is Mode.TAKEOFF:
            return self.takeoff(math.nan)
        self._enter(mode)
        return OK

    def takeoff(self, altitude: float) -> Verdict:
        """Take off, now or when armed, to a height of the vehicle, m ENU; NaN: by MIS_TAKEOFF_ALT."""
        if self.terminated:
            return deny("Take-off refused: the flight was terminated; disarm first")
        if self.flying and self.stage is not Stage.ASCENT:
            return not_now("Take-off refused: already flying; send a point to go to instead")
        fence = self.fence
        if fence is None or self.view is None:
            return not_now("Take-off refused: no position yet; start the plant")
        if math.isinf(altitude):
            return deny("Take-off refused: the altitude is no number")
        if not math.isnan(altitude) and altitude <= fence.home[2]:
            above = altitude - fence.home[2]
            return deny(f"Take-off refused: {above:.1f} m above home; altitude is above mean sea level")
        height = self._height_of_takeoff(altitude)
        fault = fence.outside((fence.home[0], fence.home[1], height))
        if fault:
            return deny(f"Take-off refused: {fault}")
        self._takeoff_height = altitude
        if self.stage is not Stage.ASCENT:
            self._enter(Mode.TAKEOFF)
        return OK

    def reposition(self, where: Reposition, change_mode: bool) -> Verdict:
        """Go to a point and hold there; what is NaN stays as it is."""
        view = self.view
        if view is None or not self.flying or self.terminated:
            return not_now("Going there refused: not flying; take off first")
        if self.stage is Stage.ASCENT:
            return not_now("Going there refused: still taking off; wait until that is done (IN_AIR)")
        if self.stage is Stage.DESCENT and self._descent is not None and not self._descent.hangs:
            return not_now("Going there refused: the load is on the ground; take off again first")
        if not change_mode and self.mode is not Mode.HOLD:
            return not_now(
                f"Going there refused: in {self.mode.title}; ask for a change of mode (param2 = 1)"
            )
        if any(math.isinf(x) for x in (*where.position, where.yaw)):
            return deny("Going there refused: position or heading is infinite")
        body = view.load_position if where.of_load else view.position
        new = tuple(old if math.isnan(x) else x for x, old in zip(where.position, body, strict=True))
        point: Triple = (new[0], new[1], new[2])
        vehicle = self._vehicle_point(point, where.of_load)
        stays = all(math.isnan(x) for x in where.position)
        fault = "" if stays or self.fence is None else self.fence.refuses(vehicle)
        if fault:
            return deny(f"Going there refused: {fault}")
        speed = self._horizontal_limit(where.speed)
        self._enter(Mode.HOLD)
        if not stays:
            self._point = self._controlled(vehicle)
        self._yaw = self._yaw if math.isnan(where.yaw) else where.yaw
        self._speed = speed
        return OK

    def change_speed(self, speed: float) -> Verdict:
        """Largest horizontal speed until the mode changes, m/s; -1: the default."""
        largest = self.parameters["MPC_XY_VEL_MAX"]
        if speed != -1 and not 0 < speed <= largest:
            return deny(
                f"Speed {speed:g} m/s refused: use up to {largest:g} (MPC_XY_VEL_MAX), or -1 for the default"
            )
        self._speed = math.nan if speed == -1 else speed
        self.mission.speed = self._speed
        return OK

    def offer(self, setpoint: Setpoint, sender: object, now: float) -> str:
        """An offboard set-point; returns why it is not taken, or an empty string."""
        fence = self.fence
        if fence is None or self.view is None:
            return "Set-point refused: no position yet; start the plant"
        here = self.view.load_position if setpoint.of_load else self.view.position
        new = tuple(old if math.isnan(x) else x for x, old in zip(setpoint.position, here, strict=True))
        point = self._vehicle_point((new[0], new[1], new[2]), setpoint.of_load)
        asked = any(not math.isnan(x) for x in setpoint.position)
        low = not math.isnan(setpoint.position[2])
        fault = (fence.outside(point) if asked else "") or (fence.too_low(point) if low else "")
        if fault:
            return f"Set-point refused: {fault}"
        return self.offboard.offer(setpoint, sender, now, self.parameters["COM_OF_LOSS_T"])

    def check_plan(self, items: tuple[Item, ...]) -> Fault | None:
        """The first fault of a plan."""
        home = self.home or (0.0, 0.0, 0.0)
        fence = fence_around(home, self.parameters, self.profile)
        return plan.check(items, self.profile, self.home_geodetic(), fence)

    def accept_plan(self, items: tuple[Item, ...]) -> Fault | None:
        """Take a plan, or say why not."""
        if self.armed and self.mode is Mode.MISSION:
            return Fault(14, "it is being flown; pause it first")  # MAV_MISSION_DENIED
        fault = self.check_plan(items)
        if fault is None:
            self.mission.replace(items)
        return fault

    def set_current_item(self, seq: int) -> Verdict:
        """Go on with another item of the plan."""
        fault = self.mission.jump(seq)
        return deny(fault) if fault else OK

    # Time

    def update(self, view: VehicleView, now: float, last_station: float | None) -> Target:
        """What the law is to do now. The same object as before if nothing has changed."""
        self.view = view
        if not self.armed:
            if view.health.position and view.in_reach and view.hil_age < math.inf:
                self._set_home(view)
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
        situation = Situation(
            self.mode is Mode.OFFBOARD, self._setpoint_fresh(now), last_station, self._armed_at
        )
        fence = fence_around(self.home, self.parameters, self.profile, view.load_attached)
        for trigger in self.failsafes.check(view, now, situation, self.parameters, fence):
            self._say(trigger.severity, trigger.text)
            if trigger.reaction is Reaction.TERMINATE:
                self._terminate("")
            elif trigger.reaction > _SEVERITY_OF_MODE.get(self.mode, Reaction.NONE):
                ground = self.profile.has_ground or trigger.reaction is not Reaction.LAND
                self._enter(_REACTION_MODES[trigger.reaction] if ground else Mode.HOLD)

    def _step(self, view: VehicleView, now: float) -> Target:
        if self.terminated:
            return Terminate()
        if self.stage is Stage.GROUND:
            self._on_ground(view, now)
        if not self.armed:
            return Idle(False)
        if self.stage is Stage.GROUND:
            return Idle(True)
        if self.stage is Stage.ASCENT and self._ascent is not None:
            target = self._ascent.target(view)
            self._after_ascent(self._ascent, view)
            return target
        if self.stage is Stage.DESCENT and self._descent is not None:
            return self._descend(self._descent, view)
        return self._fly(view, now)

    def _on_ground(self, view: VehicleView, now: float) -> None:
        if self.mode in (Mode.TAKEOFF, Mode.MISSION) or (
            self.mode is Mode.OFFBOARD and self._setpoint_fresh(now)
        ):
            self._ascend(view)
            return
        name = "COM_DISARM_LAND" if self._landed else "COM_DISARM_PRFLT"
        limit = self.parameters[name]
        if 0 <= limit < view.time - self._ready_since:
            reason = "landed" if self._landed else f"no take-off within {limit:g} s ({name})"
            self._disarm(f"Disarmed: {reason}")

    def _ascend(self, view: VehicleView) -> None:
        altitude = self._takeoff_height
        if self.mode is Mode.MISSION:
            first = next((item for item in self.mission.items if item.command in plan.WITH_POSITION), None)
            if first is not None and first.command == plan.TAKEOFF:
                altitude = plan.place(first, self.profile, self.home_geodetic())[2]
        height = self._height_of_takeoff(altitude)
        asked = self._asked_height(altitude)
        if height > asked + 0.01 and self.home is not None:
            self._say(
                INFO, f"Taking off to {height - self.home[2]:.1f} m, so that the load leaves the ground"
            )
        self._ascent = Ascent(height, self.parameters["MPC_TKO_SPEED"], self.profile, view)
        self._yaw = euler_from_quaternion(view.attitude)[2]
        self.stage = Stage.ASCENT

    def _after_ascent(self, ascent: Ascent, view: VehicleView) -> None:
        done = ascent.step.name == "DONE"
        if self.mode is Mode.LAND:
            self._land(view, view.load_position)
        elif done or (
            ascent.carries and not view.load_on_ground and self.mode is not Mode.TAKEOFF and self._clear(view)
        ):
            self.stage = Stage.FLYING
            self._ascent = None
            self._point = ascent.target(view).position if done else self._stopping_point(view)
            if self.mode is Mode.TAKEOFF:
                self._set_mode(Mode.HOLD)
            self._start(self.mode)

    def _clear(self, view: VehicleView) -> bool:
        fence = self.fence
        return fence is None or view.position[2] >= fence.home[2] + fence.least_height

    def _descend(self, descent: Descent, view: VehicleView) -> Target:
        if self.mode not in (Mode.LAND, Mode.RTL):
            if descent.hangs:
                self.stage = Stage.FLYING
                self._hold_here(view)
                self._start(self.mode)
                return self._hold_target()
            self._ascend(view)
            return self.target
        target = descent.target(view)
        if descent.step.name == "DONE":
            self.stage = Stage.GROUND
            self._landed = True
            self._ready_since = view.time
            self._set_mode(Mode.HOLD)
            self._say(INFO, "Landed")
            return Idle(True)
        return target

    def _fly(self, view: VehicleView, now: float) -> Target:
        if self.mode is Mode.LAND:
            self._land(view, self._stopping_point(view))
            return self._descend(self._descent, view) if self._descent else self._hold_target()
        if self.mode is Mode.RTL:
            return self._return_home(view)
        if self.mode is Mode.MISSION:
            return self._fly_mission(view)
        if self.mode is Mode.OFFBOARD and self.offboard.latest is not None:
            return self._follow(self.offboard.latest, view)
        return self._hold_target()

    # Modes in flight

    def _enter(self, mode: Mode) -> None:
        """Change the mode; in flight it begins now."""
        if self.mode is Mode.MISSION and mode is not Mode.MISSION:
            self.mission.pause()
        again = mode is self.mode and mode not in (Mode.HOLD, Mode.RTL)
        self._set_mode(mode)
        if self.view is not None and self.armed and self.stage is Stage.FLYING and not again:
            self._hold_here(self.view)
            self._start(mode)

    def _start(self, mode: Mode) -> None:
        """Begin a mode in flight, from where the vehicle holds."""
        self._speed = math.nan
        self._return = _Return.CLIMB
        if mode is Mode.MISSION:
            self.mission.start()

    def _hold_here(self, view: VehicleView) -> None:
        self._point = self._stopping_point(view)
        self._yaw = euler_from_quaternion(view.attitude)[2]
        self._speed = math.nan

    def _stopping_point(self, view: VehicleView) -> Triple:
        """Where the controlled body comes to rest if it brakes now, m."""
        position, velocity = (
            (view.load_position, view.load_velocity) if view.load_attached else (view.position, view.velocity)
        )
        speed = math.hypot(*velocity)
        if speed == 0.0:
            return position
        share = stopping_distance(speed, self.parameters["MPC_ACC_HOR"]) / speed
        x, y, z = (p + v * share for p, v in zip(position, velocity, strict=True))
        return (x, y, z)

    def _hold_target(self) -> Goto:
        return Goto(self._body(), self._point, self._yaw, self._horizontal_limit(self._speed))

    def _return_home(self, view: VehicleView) -> Target:
        home = self.home or (0.0, 0.0, 0.0)
        hanging = self.profile.hover_length if view.load_attached else 0.0
        over = self._home_load if view.load_attached else home
        here = view.load_position if view.load_attached else view.position
        if self._return is _Return.CLIMB:
            near = math.hypot(here[0] - over[0], here[1] - over[1]) < self.parameters["RTL_MIN_DIST"]
            height = here[2] if near else max(here[2], home[2] + self.parameters["RTL_RETURN_ALT"] - hanging)
            start = (self._point[0], self._point[1])
            self._point = (*(over[:2] if near else start), height)
            if near or abs(here[2] - height) < _NEAR:
                self._return = _Return.CRUISE
                self._point = (over[0], over[1], height)
        elif self._return is _Return.CRUISE:
            if math.dist(here, self._point) < _NEAR:
                self._return = _Return.WAIT
                self._since = view.time
        else:
            delay = self.parameters["RTL_LAND_DELAY"]
            if 0 <= delay <= view.time - self._since and self.profile.has_ground:
                self._land(view, over, home)
        return self._hold_target()

    def _land(self, view: VehicleView, place: Triple, stand: Triple | None = None) -> None:
        p = self.parameters
        ground = (self.home or (0.0, 0.0, 0.0))[2]
        self._ascent = None
        self._descent = Descent(
            place,
            ground,
            p["MPC_LAND_SPEED"],
            p["MPC_Z_VEL_MAX_DN"],
            p["LND_BESIDE"],
            self.profile,
            view,
            stand,
        )
        self.stage = Stage.DESCENT

    def _fly_mission(self, view: VehicleView) -> Target:
        hanging = self.profile.hover_length if view.load_attached else 0.0
        home = self.home_geodetic()
        step = self.mission.advance(
            view, lambda item: plan.place(item, self.profile, home), hanging, self.parameters["NAV_ACC_RAD"]
        )
        if isinstance(step, Then):
            self._after_mission(step, view)
            return self._hold_target()
        self._speed = self.mission.speed
        if step.point is not None:
            self._point = self._controlled(step.point)
        self._yaw = self._yaw if math.isnan(step.yaw) else step.yaw
        return self._hold_target()

    def _after_mission(self, then: Then, view: VehicleView) -> None:
        point, yaw = self._point, self._yaw
        if then is Then.RETURN:
            self._enter(Mode.RTL)
            return
        if then is Then.LAND:
            self._set_mode(Mode.LAND)
            self._land(view, self._point)
            return
        if then is Then.LOST:
            self._say(WARNING, "Mission stopped: its jumps go in circles; holding")
            self.mission.pause()
        elif then is Then.PAUSE:
            self._say(INFO, "Mission waits (autocontinue 0); start it again to go on")
        else:
            self._say(INFO, "Mission finished; holding")
        self._set_mode(Mode.HOLD)
        self._point, self._yaw, self._speed = point, yaw, math.nan

    def _follow(self, asked: Setpoint, view: VehicleView) -> Target:
        attached = view.load_attached
        position, velocity = asked.position, self._limited(asked.velocity)
        if attached and not asked.of_load:
            x, y, z = (p - d for p, d in zip(position, self._hanging(asked.acceleration), strict=True))
            position = (x, y, z)
        plain = all(math.isnan(v) for v in (*asked.velocity, *asked.acceleration, asked.yaw_rate))
        self._yaw = self._yaw if math.isnan(asked.yaw) else asked.yaw
        if plain:
            self._point = position
            return Goto(self._body(), position, self._yaw, self.parameters["MPC_XY_VEL_MAX"])
        return Follow(self._body(), position, velocity, asked.acceleration, asked.yaw, asked.yaw_rate)

    # Small conversions

    def _hanging(self, acceleration: Triple) -> Triple:
        """From the load to the vehicle for a steady acceleration (NaN: none), m."""
        pull = [0.0 if math.isnan(a) else a for a in acceleration]
        pull[2] += GRAVITY
        size = math.hypot(*pull)
        if size < 1e-3:
            return (0.0, 0.0, self.profile.hover_length)
        scale = self.profile.hover_length / size
        return (pull[0] * scale, pull[1] * scale, pull[2] * scale)

    def _limited(self, velocity: Triple) -> Triple:
        p = self.parameters
        flat = math.hypot(*(0.0 if math.isnan(v) else v for v in velocity[:2]))
        scale = min(1.0, p["MPC_XY_VEL_MAX"] / flat) if flat > 0 else 1.0
        z = velocity[2]
        up = z if math.isnan(z) else max(-p["MPC_Z_VEL_MAX_DN"], min(p["MPC_Z_VEL_MAX_UP"], z))
        return (velocity[0] * scale, velocity[1] * scale, up)

    def _horizontal_limit(self, speed: float) -> float:
        asked = speed if speed > 0 else self.parameters["MPC_XY_CRUISE"]
        return min(asked, self.parameters["MPC_XY_VEL_MAX"])

    def _body(self) -> Body:
        return Body.LOAD if self.view is None or self.view.load_attached else Body.VEHICLE

    def _vehicle_point(self, point: Triple, of_load: bool) -> Triple:
        return (point[0], point[1], point[2] + self.profile.hover_length) if of_load else point

    def _controlled(self, vehicle: Triple) -> Triple:
        """The controlled body's point for a vehicle's point."""
        if self._body() is Body.VEHICLE:
            return vehicle
        return (vehicle[0], vehicle[1], vehicle[2] - self.profile.hover_length)

    def _asked_height(self, altitude: float) -> float:
        home = self.home or (0.0, 0.0, 0.0)
        return home[2] + self.parameters["MIS_TAKEOFF_ALT"] if math.isnan(altitude) else altitude

    def _height_of_takeoff(self, altitude: float) -> float:
        home = self.home or (0.0, 0.0, 0.0)
        least = self.fence.least_height if self.fence is not None else 0.0
        return max(self._asked_height(altitude), home[2] + least)

    def _setpoint_fresh(self, now: float) -> bool:
        return self.offboard.fresh(now, self.parameters["COM_OF_LOSS_T"])

    def _set_home(self, view: VehicleView) -> None:
        self.home = view.position
        self._home_load = view.load_position

    def _set_mode(self, mode: Mode) -> None:
        if mode is not self.mode:
            self.mode = mode
            self._say(INFO, f"Mode: {mode.title}")

    def _disarm(self, text: str) -> None:
        self.armed = False
        self.stage = Stage.GROUND
        self._ascent = self._descent = None
        self._takeoff_height = math.nan
        self.mission.pause()
        self.failsafes.reset()
        self.mode = Mode.HOLD
        self._say(INFO, text)

    def _terminate(self, text: str) -> None:
        self.terminated = True
        self.mode = Mode.TERMINATION
        self.mission.pause()
        if text:
            self._say(EMERGENCY, text)

    def _say(self, severity: int, text: str) -> None:
        self.notices.append(Notice(severity, text))


def _same(a: Target, b: Target) -> bool:
    """Equal, a NaN counting as equal to a NaN."""
    return type(a) is type(b) and repr(a) == repr(b)
