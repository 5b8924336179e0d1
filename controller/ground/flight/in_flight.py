"""The modes in flight: where each takes a vehicle whose load hangs clear, or that flies without one.

mode               | goes to
-------------------+-----------------------------------------------------------------------
HOLD               | the hover point, or round the figure of eight that was asked for
MISSION            | item by item; then HOLD, RTL or a landing, as the plan ends
RTL                | above home, or the nearest rally point; there it lands
OFFBOARD           | the client's set-point; without one the hover point
POSITION, ALTITUDE | the set-point that the sticks make
ORBIT              | round the orbit; then HOLD, after the turns that were asked for
FOLLOW_TARGET      | after the target; the hover point until there is one
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

from controller.ground.commands.result import INFO, WARNING
from controller.ground.commands.setpoints import Setpoint
from controller.ground.flight.home import Home
from controller.ground.flight.hover_point import HoverPoint
from controller.ground.flight.limits.fence import Fence
from controller.ground.flight.limits.fence_zones import Place
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
from controller.ground.flight.motion.region_of_interest import heading_to
from controller.ground.flight.motion.setpoint_types import Goto, Target
from controller.ground.flight.motion.trajectory import motion_pole
from controller.ground.flight.px4_modes import BY_STICKS, Mode
from controller.ground.flight.stages.return_home import ReturnHome, nearest_rally_point
from controller.ground.missions import mission_plan as plan
from controller.ground.parameters.protocol import Parameters
from controller.ground.telemetry.vehicle_state import Profile, VehicleView
from sitl_bridge.frames import Triple, euler_from_quaternion


class Pilot(Protocol):
    """Who has the mode."""

    mode: Mode

    def set_mode_to(self, mode: Mode) -> None:
        """Have another mode from now on, of guidance's own accord."""

    def enter(self, mode: Mode) -> None:
        """Change the mode as a request would; in flight it begins now."""

    def say(self, severity: int, text: str) -> None:
        """A STATUSTEXT to everybody."""


Land = Callable[[VehicleView, Triple, "Triple | None"], None]
"""Begin to land: the place of the load (m), and that of the vehicle if it is known"""


class InFlight:
    """What the modes in flight keep."""

    def __init__(
        self,
        profile: Profile,
        parameters: Parameters,
        mission: MissionFlight,
        pilot: Pilot,
        home: Home,
        hover: HoverPoint,
        fence: Callable[[bool], Fence],
        land: Land,
    ) -> None:
        self.rally_points: tuple[Place, ...] = ()
        self.pattern: Pattern | None = None
        """An orbit in ORBIT, a figure of eight in HOLD"""
        self.looks_at: Triple | None = None
        """m ENU, where the yaw points in HOLD"""
        self.followed = FollowTarget()
        self._profile = profile
        self._parameters = parameters
        self._mission = mission
        self._pilot = pilot
        self._home = home
        self._hover = hover
        self._fence = fence
        self._land = land
        self._pole = motion_pole(profile.hover_length, profile.gravity)
        self._following = Following(profile, parameters, fence, pilot.say)
        self._return: ReturnHome | None = None
        self._silent = False
        """Nobody says where he is to be followed to, and that was said"""

    def end(self) -> None:
        """Disarmed."""
        self._return = self.pattern = self.looks_at = None

    def start(self, mode: Mode) -> None:
        """Begin a mode in flight, from where the vehicle holds."""
        self._hover.speed = math.nan
        self._return = None
        self._following.start()
        if mode is Mode.MISSION:
            self._mission.start()
        elif mode is Mode.FOLLOW_TARGET:
            self.followed.start()

    def go_to(self, vehicle: Triple | None, yaw: float, speed: float, view: VehicleView) -> None:
        """Hold at a point of the vehicle (m; None: where it holds now); a yaw of NaN stays as it is."""
        if vehicle is not None:
            self._hover.stay_at(controlled_point(vehicle, view, self._profile), controlled_body(view))
        if not math.isnan(yaw):
            self._hover.yaw = yaw
            self.looks_at = self.looks_at if self._pilot.mode is Mode.MISSION else None
        self._hover.speed = speed

    def hold_here(self, view: VehicleView) -> None:
        """Come to rest, and stay."""
        x, y, z = stopping_point(view, self._parameters, self._pole)
        least = min(self._following.floor(view), height_of(view))
        self._hover.stay_at((x, y, max(z, least)), controlled_body(view))
        self._hover.yaw = euler_from_quaternion(view.attitude)[2]
        self._hover.speed = math.nan

    def hold(self) -> Goto:
        """Where the vehicle holds."""
        speed = limited_speed(self._hover.speed, self._parameters)
        return Goto(self._hover.body, self._hover.point, self._hover.yaw, speed)

    def floor(self, view: VehicleView) -> float:
        """Least height of the controlled body, m ENU; -inf without a ground."""
        return self._following.floor(view)

    def without_load(self) -> None:
        """The vehicle holds, and returns, where it would have been above the load."""
        self._hover.without_load()
        if self._return is not None:
            self._return.without_load(self._profile.hover_length)

    def target(self, view: VehicleView, setpoint: Setpoint | None) -> Target:
        """Where the mode takes the vehicle now. `setpoint`: by client or pilot."""
        mode = self._pilot.mode
        if mode is Mode.RTL:
            return self._return_home(view)
        if mode is Mode.MISSION:
            return self._fly_mission(view)
        if mode is Mode.FOLLOW_TARGET:
            return self._follow_target(view)
        if self.pattern is not None or mode is Mode.ORBIT:
            return self._fly_pattern(view)
        if mode is Mode.HOLD and self.looks_at is not None:
            self._hover.yaw = heading_to(view.position, self.looks_at, self._hover.yaw)
        if mode not in (Mode.OFFBOARD, *BY_STICKS) or setpoint is None:
            return self.hold()
        return self._follow(setpoint, view)

    def _follow(self, asked: Setpoint, view: VehicleView) -> Target:
        self._hover.yaw = self._hover.yaw if math.isnan(asked.yaw) else asked.yaw
        target = self._following.target(asked, view, self._hover.yaw)
        if isinstance(target, Goto):
            self._hover.stay_at(target.position, target.body)
        return target

    def _follow_target(self, view: VehicleView) -> Target:
        asked = self.followed.setpoint(view, self._home.or_origin, self._parameters)
        self._silent = self._said_once(
            self._silent, self.followed.silent(view), "Nobody to follow: no FOLLOW_TARGET; waiting"
        )
        return self.hold() if asked is None else self._follow(asked, view)

    def _said_once(self, before: bool, now: bool, text: str) -> bool:
        if now and not before:
            self._pilot.say(WARNING, text)
        return now

    def _fly_pattern(self, view: VehicleView) -> Target:
        if self.pattern is None:  # the mode was asked for without an orbit: as PX4, round where it is
            self.pattern = Orbit(view.position, 1.0, 1.0, Yaw.TO_CENTRE, 0.0)
        target = self._follow(self.pattern.setpoint(view, self._profile), view)
        if isinstance(self.pattern, Orbit) and self.pattern.over:
            self._pilot.say(INFO, "Orbit finished; holding")
            self._pilot.enter(Mode.HOLD)
        return target

    def _return_home(self, view: VehicleView) -> Target:
        if self._return is None:
            home, load = self._home.or_origin, self._home.load
            rally = nearest_rally_point(self.rally_points, view.position, home, self._parameters)
            if rally is not None:
                home, load = (*rally, home[2]), (*rally, load[2])
                self._pilot.say(INFO, "Returning to the nearest rally point")
            self._return = ReturnHome(home, load, self._hover.point, None if rally is not None else home)
        if self._return.arrived(view, self._parameters, self._profile):
            self._land(view, self._return.place(view), self._return.stand)
        self._hover.stay_at(self._return.point, controlled_body(view))
        return self.hold()

    def _fly_mission(self, view: VehicleView) -> Target:
        hanging = self._profile.hover_length if view.load_attached else 0.0
        radius = self._parameters["NAV_ACC_RAD"]
        step = self._mission.advance(
            view,
            lambda item: self._place(item, view),
            hanging,
            radius,
            lambda home: self._home.move_to(home[0], home[1]),
        )
        if isinstance(step, Then):
            self._after_mission(step, view)
        else:
            self.go_to(step.point, step.yaw, self._mission.speed, view)
        return self.hold()

    def _place(self, item: plan.Item, view: VehicleView) -> Triple:
        """Of the vehicle, m: as the item says, or as high as the load needs (where it takes off or lands)."""
        x, y, z = plan.place(item, self._profile.origin, self._home.geodetic())
        fence = self._fence(view.load_attached)
        return (x, y, max(z, fence.home[2] + fence.least_height))

    def _after_mission(self, then: Then, view: VehicleView) -> None:
        if then is Then.RETURN:
            self._pilot.enter(Mode.RTL)
            return
        if then is Then.LAND:
            self._pilot.set_mode_to(Mode.LAND)
            self._land(view, self._hover.point, None)
            return
        if then is Then.LOST:
            self._pilot.say(WARNING, "Mission stopped: its jumps form an endless loop; holding")
            self._mission.pause()
        elif then is Then.PAUSE:
            self._pilot.say(INFO, "Mission waits (autocontinue 0); start it again to go on")
        else:
            self._pilot.say(INFO, "Mission finished; holding")
        self._pilot.set_mode_to(Mode.HOLD)
        self._hover.speed = math.nan
