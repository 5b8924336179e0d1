"""From the ground into the air, through the modes in flight, and down again: the target of each moment.

What is controlled in flight is the load, one cable length below the vehicle; points that clients ask for are
the vehicle's unless addressed to the load.
"""

from __future__ import annotations

import math
from enum import Enum, auto
from typing import Protocol

from controller.ground.commands.result import INFO, WARNING
from controller.ground.commands.setpoints import Setpoint
from controller.ground.flight.home import Home
from controller.ground.flight.hover_point import HoverPoint
from controller.ground.flight.limits.fence import Fence, fence_around
from controller.ground.flight.limits.fence_zones import Place, Zone
from controller.ground.flight.mission_flight import MissionFlight, Then
from controller.ground.flight.motion.follow_target import FollowTarget
from controller.ground.flight.motion.following import Following, height_of
from controller.ground.flight.motion.geometry import (
    controlled_body,
    controlled_point,
    limited_speed,
    stopping_point,
)
from controller.ground.flight.motion.patterns import Orbit, Pattern, Yaw
from controller.ground.flight.motion.setpoint_types import Attitude, Body, Goto, Idle, Target
from controller.ground.flight.motion.trajectory import motion_pole
from controller.ground.flight.px4_modes import BY_STICKS, Mode
from controller.ground.flight.stages.ascent import Ascent, Step
from controller.ground.flight.stages.descent import Descent
from controller.ground.flight.stages.descent import Step as DescentStep
from controller.ground.flight.stages.return_home import ReturnHome, nearest_rally_point
from controller.ground.missions import mission_plan as plan
from controller.ground.missions.item_types import TAKEOFF, WITH_POSITION
from controller.ground.parameters.protocol import Parameters
from controller.ground.telemetry.vehicle_state import Profile, VehicleView
from sitl_bridge.frames import Triple, euler_from_quaternion

_LIFTING = 0.5
"""Share of the hover thrust below which a vehicle on the ground stays there"""


class Stage(Enum):
    """How far the vehicle is off the ground."""

    GROUND = auto()
    ASCENT = auto()
    FLYING = auto()
    DESCENT = auto()


class Pilot(Protocol):
    """Who has the mode."""

    mode: Mode

    def set_mode_to(self, mode: Mode) -> None:
        """Have another mode from now on, of guidance's own accord."""

    def enter(self, mode: Mode) -> None:
        """Change the mode as a request would; in flight it begins now."""

    def say(self, severity: int, text: str) -> None:
        """A STATUSTEXT to everybody."""


class Guidance:
    """The stages of one flight after another, and where each mode takes it."""

    def __init__(
        self, profile: Profile, parameters: Parameters, mission: MissionFlight, pilot: Pilot
    ) -> None:
        self.stage = Stage.GROUND
        self.home = Home(profile.origin)
        self.takeoff_height = math.nan
        """m ENU, of the vehicle, that a take-off was asked for; NaN: by MIS_TAKEOFF_ALT"""
        self.hover = HoverPoint(profile)
        """Where it holds, and heads for"""
        self.zones: tuple[Zone, ...] = ()
        """Of the geofence"""
        self.rally_points: tuple[Place, ...] = ()
        self.landed_at = -math.inf
        """s of the plant's time, when the last landing was over"""
        self._profile = profile
        self._pole = motion_pole(profile.hover_length, profile.gravity)
        self._parameters = parameters
        self._mission = mission
        self._pilot = pilot
        self._ascent: Ascent | None = None
        self._descent: Descent | None = None
        self._return: ReturnHome | None = None
        self._silent = False
        """Nobody says where he is to be followed to, and that was said"""
        self._following = Following(profile, parameters, self.fence, pilot.say)
        self.pattern: Pattern | None = None
        """An orbit in ORBIT, a figure of eight in HOLD"""
        self.followed = FollowTarget()
        self._destination: tuple[Triple, float, float] | None = None
        """Of a reposition that waits for the end of a take-off: vehicle (m), yaw (rad), speed (m/s)"""

    # Where it begins

    def fence(self, with_load: bool = True) -> Fence:
        """The limits around home."""
        return fence_around(self.home.or_origin, self._parameters, self._profile, with_load, self.zones)

    def begin(self, view: VehicleView) -> None:
        """Armed: on the ground, or in the air already."""
        self.home.set_here(view)
        self.stage = Stage.GROUND if view.vehicle_on_ground else Stage.FLYING
        if self.stage is Stage.FLYING:
            if self._profile.has_ground:  # heights above home are above the ground
                self.home.set_below(view, self._profile.ground_height)
            self.hold_here(view)

    def end(self) -> None:
        """Disarmed."""
        self.stage = Stage.GROUND
        self._ascent = self._descent = self._return = self._destination = self.pattern = None
        self.hover.picked_up()
        self.takeoff_height = math.nan

    # What is asked of it

    @property
    def load_is_down(self) -> bool:
        """Whether a landing has set the load down, so that only a take-off gets it up again."""
        return self.stage is Stage.DESCENT and self._descent is not None and not self._descent.hangs

    def hold_here(self, view: VehicleView) -> None:
        """Come to rest, and stay."""
        x, y, z = stopping_point(view, self._parameters, self._pole)
        least = min(self._following.floor(view), height_of(view))
        self.hover.stay_at((x, y, max(z, least)), controlled_body(view))
        self.hover.yaw = euler_from_quaternion(view.attitude)[2]
        self.hover.speed = math.nan

    def go_to(self, vehicle: Triple | None, yaw: float, speed: float, view: VehicleView) -> None:
        """Hold at a point of the vehicle (m; None: where it holds now); a yaw of NaN stays as it is.

        While the load is not yet controlled, this waits until it is.
        """
        if self.stage is not Stage.FLYING:
            self._destination = None if vehicle is None else (vehicle, yaw, speed)
            return
        if vehicle is not None:
            self.hover.stay_at(self._controlled(vehicle, view), controlled_body(view))
        self.hover.yaw = self.hover.yaw if math.isnan(yaw) else yaw
        self.hover.speed = speed

    def forget_destination(self) -> None:
        """Something else is asked for than the point that waits for the take-off's end, or the pattern."""
        self._destination = self.pattern = None

    def ask_takeoff_height(self, altitude: float, view: VehicleView) -> None:
        """Height (vehicle, m ENU) of the take-off to come or under way; NaN: the default, or as it is."""
        if self.stage is not Stage.ASCENT or self._ascent is None:
            self.takeoff_height = altitude
        elif not math.isnan(altitude):
            self._ascent.change_height(self.height_of_takeoff(altitude, view))

    def break_off_landing(self) -> None:
        """Fly on, if the load still hangs; one that lies is picked up by a take-off."""
        if self.stage is Stage.DESCENT and not self.load_is_down:
            self.stage = Stage.FLYING
            self._descent = None

    def start(self, mode: Mode) -> None:
        """Begin a mode in flight, from where the vehicle holds."""
        self.hover.speed = math.nan
        self._return = None
        self._following.start()
        if mode is Mode.MISSION:
            self._mission.start()
        elif mode is Mode.FOLLOW_TARGET:
            self.followed.start()

    def take_off(self, view: VehicleView) -> None:
        """Leave the ground, to the height that was asked for or that the mission begins with."""
        altitude = self.takeoff_height
        if self._pilot.mode is Mode.MISSION:
            items = self._mission.items
            first = next((item for item in items if item.command in WITH_POSITION), None)
            if first is not None and first.command == TAKEOFF:
                altitude = plan.place(first, self._profile.origin, self.home.geodetic())[2]
        height = self.height_of_takeoff(altitude, view)
        if height > self._asked_height(altitude) + 0.01 and self.home.position is not None:
            above = f"{height - self.home.position[2]:.1f} m"
            self._pilot.say(INFO, f"Taking off to {above}, so that the load leaves the ground")
        self._ascent = Ascent(height, self._parameters["MPC_TKO_SPEED"], self._profile, view)
        self.hover.yaw = euler_from_quaternion(view.attitude)[2]
        self.stage = Stage.ASCENT

    def _asked_height(self, altitude: float) -> float:
        home = self.home.or_origin
        return home[2] + self._parameters["MIS_TAKEOFF_ALT"] if math.isnan(altitude) else altitude

    def height_of_takeoff(self, altitude: float, view: VehicleView | None) -> float:
        """Of the vehicle, m ENU: as asked (NaN: by MIS_TAKEOFF_ALT), or as high as the load needs."""
        fence = self.fence(view is None or view.load_attached)
        return max(self._asked_height(altitude), fence.home[2] + fence.least_height)

    def lifts(self, setpoint: Setpoint | Attitude | None) -> bool:
        """Whether a client that steers the attitude gives a thrust that is meant to fly."""
        hover = self._parameters["MPC_THR_HOVER"]
        return isinstance(setpoint, Attitude) and setpoint.thrust > _LIFTING * hover

    # Where to go now

    def target(self, view: VehicleView, setpoint: Setpoint | Attitude | None, last: Target) -> Target:
        """Off the ground: what to do now. `setpoint`: by client or pilot; `last`: the target before."""
        if self.hover.body is Body.LOAD and not view.load_attached:
            self._go_on_without_load()
        if self.stage is Stage.ASCENT and self._ascent is not None:
            target = self._ascent.target(view)
            self._after_ascent(self._ascent, view)
            return target
        if self.stage is Stage.DESCENT and self._descent is not None:
            return self._descend(self._descent, view, last)
        self.hover.note_set_down(view)
        return self._fly(view, setpoint, last)

    def _after_ascent(self, ascent: Ascent, view: VehicleView) -> None:
        done, mode = ascent.step is Step.DONE, self._pilot.mode
        if mode is Mode.LAND:
            self._land(view, view.load_position)
        elif done or (
            ascent.carries and not view.load_on_ground and mode is not Mode.TAKEOFF and self._clear(view)
        ):
            self.stage = Stage.FLYING
            self._ascent = None
            reached = ascent.target(view)
            if done:
                self.hover.stay_at(reached.position, reached.body)
            else:
                self.hover.stay_at(stopping_point(view, self._parameters, self._pole), controlled_body(view))
            if mode is Mode.TAKEOFF:
                self._pilot.set_mode_to(Mode.HOLD)
            self.start(self._pilot.mode)
            if self._destination is not None:
                self.go_to(*self._destination, view)
                self._destination = None

    def _clear(self, view: VehicleView) -> bool:
        fence = self.fence(view.load_attached)
        return view.position[2] >= fence.home[2] + fence.least_height

    def _descend(self, descent: Descent, view: VehicleView, last: Target) -> Target:
        if self._pilot.mode not in (Mode.LAND, Mode.RTL):  # with the load down: `break_off_landing`
            self._pilot.say(INFO, "Landing broken off: taking off again")
            self.take_off(view)
            return last
        target = descent.target(view)
        if descent.step is DescentStep.DONE:
            self.stage = Stage.GROUND
            self.landed_at = view.time
            self._pilot.set_mode_to(Mode.HOLD)
            self._pilot.say(INFO, "Landed")
            return Idle(True)
        return target

    def _fly(self, view: VehicleView, setpoint: Setpoint | Attitude | None, last: Target) -> Target:
        mode = self._pilot.mode
        if mode is Mode.LAND:
            self._land(view, stopping_point(view, self._parameters, self._pole))
            return self._descend(self._descent, view, last) if self._descent else self._hold()
        if mode is Mode.RTL:
            return self._return_home(view)
        if mode is Mode.MISSION:
            return self._fly_mission(view)
        if mode is Mode.FOLLOW_TARGET:
            return self._follow_target(view)
        if self.pattern is not None or mode is Mode.ORBIT:
            return self._fly_pattern(view)
        if mode not in (Mode.OFFBOARD, *BY_STICKS) or setpoint is None:
            return self._hold()
        if isinstance(setpoint, Attitude):
            if view.vehicle_on_ground and not self.lifts(setpoint):
                self.stage = Stage.GROUND
                self.landed_at = view.time
                return Idle(True)
            return setpoint
        return self._follow(setpoint, view)

    def _hold(self) -> Goto:
        speed = limited_speed(self.hover.speed, self._parameters)
        return Goto(self.hover.body, self.hover.point, self.hover.yaw, speed)

    def _follow_target(self, view: VehicleView) -> Target:
        asked = self.followed.setpoint(view, self.home.or_origin, self._parameters)
        self._silent = self._said_once(
            self._silent, self.followed.silent(view), "Nobody to follow: no FOLLOW_TARGET; waiting"
        )
        return self._hold() if asked is None else self._follow(asked, view)

    def _fly_pattern(self, view: VehicleView) -> Target:
        if self.pattern is None:  # the mode was asked for without an orbit: as PX4, round where it is
            self.pattern = Orbit(view.position, 1.0, 1.0, Yaw.TO_CENTRE, 0.0)
        target = self._follow(self.pattern.setpoint(view, self._profile), view)
        if isinstance(self.pattern, Orbit) and self.pattern.over:
            self._pilot.say(INFO, "Orbit finished; holding")
            self._pilot.enter(Mode.HOLD)
        return target

    def _said_once(self, before: bool, now: bool, text: str) -> bool:
        if now and not before:
            self._pilot.say(WARNING, text)
        return now

    def _go_on_without_load(self) -> None:
        """The vehicle holds, and returns, where it would have been above the load."""
        self.hover.without_load()
        if self._return is not None:
            self._return.without_load(self._profile.hover_length)

    def _controlled(self, vehicle: Triple, view: VehicleView) -> Triple:
        """The controlled body's point for a vehicle's point."""
        return controlled_point(vehicle, view, self._profile)

    def _return_home(self, view: VehicleView) -> Target:
        if self._return is None:
            home, load = self.home.or_origin, self.home.load
            rally = nearest_rally_point(self.rally_points, view.position, home, self._parameters)
            if rally is not None:
                home, load = (*rally, home[2]), (*rally, load[2])
                self._pilot.say(INFO, "Returning to the nearest rally point")
            self._return = ReturnHome(home, load, self.hover.point, None if rally is not None else home)
        if self._return.arrived(view, self._parameters, self._profile):
            self._land(view, self._return.place(view), self._return.stand)
        self.hover.stay_at(self._return.point, controlled_body(view))
        return self._hold()

    def _land(self, view: VehicleView, place: Triple, stand: Triple | None = None) -> None:
        p = self._parameters
        self._ascent = None
        self._descent = Descent(
            place,
            self.home.or_origin[2],
            p["MPC_LAND_SPEED"],
            p["MPC_Z_VEL_MAX_DN"],
            p["LND_BESIDE"],
            self._profile,
            view,
            stand,
        )
        self.stage = Stage.DESCENT

    def _fly_mission(self, view: VehicleView) -> Target:
        hanging = self._profile.hover_length if view.load_attached else 0.0
        radius = self._parameters["NAV_ACC_RAD"]
        step = self._mission.advance(
            view,
            lambda item: self._place(item, view),
            hanging,
            radius,
            lambda home: self.home.move_to(home[0], home[1]),
        )
        if isinstance(step, Then):
            self._after_mission(step, view)
        else:
            self.go_to(step.point, step.yaw, self._mission.speed, view)
        return self._hold()

    def _place(self, item: plan.Item, view: VehicleView) -> Triple:
        """Of the vehicle, m: as the item says, or as high as the load needs (where it takes off or lands)."""
        x, y, z = plan.place(item, self._profile.origin, self.home.geodetic())
        fence = self.fence(view.load_attached)
        return (x, y, max(z, fence.home[2] + fence.least_height))

    def _after_mission(self, then: Then, view: VehicleView) -> None:
        if then is Then.RETURN:
            self._pilot.enter(Mode.RTL)
            return
        if then is Then.LAND:
            self._pilot.set_mode_to(Mode.LAND)
            self._land(view, self.hover.point)
            return
        if then is Then.LOST:
            self._pilot.say(WARNING, "Mission stopped: its jumps form an endless loop; holding")
            self._mission.pause()
        elif then is Then.PAUSE:
            self._pilot.say(INFO, "Mission waits (autocontinue 0); start it again to go on")
        else:
            self._pilot.say(INFO, "Mission finished; holding")
        self._pilot.set_mode_to(Mode.HOLD)
        self.hover.speed = math.nan

    def _follow(self, asked: Setpoint, view: VehicleView) -> Target:
        self.hover.yaw = self.hover.yaw if math.isnan(asked.yaw) else asked.yaw
        target = self._following.target(asked, view, self.hover.yaw)
        if isinstance(target, Goto):
            self.hover.stay_at(target.position, target.body)
        return target
