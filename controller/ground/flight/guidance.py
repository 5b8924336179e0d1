"""From the ground into the air and down again: the stages of a flight, and the target of each moment.

What is controlled in flight is the load, one cable length below the vehicle; points that clients ask for are
the vehicle's unless addressed to the load.
"""

from __future__ import annotations

import math
from enum import Enum, auto

from controller.ground.commands.result import INFO
from controller.ground.commands.setpoints import Setpoint
from controller.ground.flight.home import Home
from controller.ground.flight.hover_point import HoverPoint
from controller.ground.flight.in_flight import InFlight, Pilot
from controller.ground.flight.limits.fence import Fence, fence_around
from controller.ground.flight.limits.fence_ahead import fence_ahead
from controller.ground.flight.limits.fence_zones import Zone
from controller.ground.flight.mission_flight import MissionFlight
from controller.ground.flight.motion.geometry import (
    controlled_body,
    stopping_point,
)
from controller.ground.flight.motion.setpoint_types import Attitude, Body, Goto, Idle, Target
from controller.ground.flight.motion.trajectory import motion_pole
from controller.ground.flight.px4_modes import Mode
from controller.ground.flight.stages.ascent import Ascent, Step
from controller.ground.flight.stages.descent import Descent
from controller.ground.flight.stages.descent import Step as DescentStep
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
        self.took_off_at = math.nan
        """s of the plant's time, when this flight left the ground; NaN: it has not"""
        self.landed_at = -math.inf
        """s of the plant's time, when the last landing was over"""
        self._profile = profile
        self._pole = motion_pole(profile.hover_length, profile.gravity)
        self._parameters = parameters
        self._mission = mission
        self._pilot = pilot
        self._ascent: Ascent | None = None
        self._descent: Descent | None = None
        self.in_flight = InFlight(
            profile, parameters, mission, pilot, self.home, self.hover, self.fence, self._land
        )
        self._destination: tuple[Triple, float, float] | None = None
        """Of a reposition that waits for the end of a take-off: vehicle (m), yaw (rad), speed (m/s)"""

    # Where it begins

    def fence(self, with_load: bool = True) -> Fence:
        """The limits around home."""
        return fence_around(self.home.or_origin, self._parameters, self._profile, with_load, self.zones)

    def fence_with_way(self, view: VehicleView, target: Target) -> Fence:
        """The limits as they are now, and whether the vehicle is about to leave them."""
        fence = self.fence(view.load_attached)
        if self.stage is not Stage.FLYING:
            return fence
        stop = stopping_point(view, self._parameters, self._pole)
        goal = target.position if isinstance(target, Goto) else None
        ahead = fence_ahead(view, fence, stop, goal, self._parameters, self._profile)
        return fence._replace(ahead=ahead) if ahead else fence

    def begin(self, view: VehicleView) -> None:
        """Armed: on the ground, or in the air already."""
        self.home.set_here(view)
        self.stage = Stage.GROUND if view.vehicle_on_ground else Stage.FLYING
        if self.stage is Stage.FLYING:
            if self._profile.has_ground:  # heights above home are above the ground
                self.home.set_below(view, self._profile.ground_height)
            self.in_flight.hold_here(view)

    def end(self) -> None:
        """Disarmed."""
        self.stage = Stage.GROUND
        self._ascent = self._descent = self._destination = None
        self.in_flight.end()
        self.hover.picked_up()
        self.takeoff_height = self.took_off_at = math.nan

    # What is asked of it

    @property
    def load_is_down(self) -> bool:
        """Whether a landing has set the load down, so that only a take-off gets it up again."""
        return self.stage is Stage.DESCENT and self._descent is not None and not self._descent.hangs

    def go_to(self, vehicle: Triple | None, yaw: float, speed: float, view: VehicleView) -> None:
        """Hold at a point of the vehicle (m; None: where it holds now); a yaw of NaN stays as it is.

        While the load is not yet controlled, this waits until it is.
        """
        if self.stage is not Stage.FLYING:
            self._destination = None if vehicle is None else (vehicle, yaw, speed)
            return
        self.in_flight.go_to(vehicle, yaw, speed, view)

    def forget_destination(self) -> None:
        """Something else is asked for than the point that waits for the take-off's end, or the pattern."""
        self._destination = self.in_flight.pattern = None

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
        self.took_off_at = view.time

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

    def floor(self, body: Body, view: VehicleView) -> float:
        """Least height of a body that is flown, m ENU; -inf for one that takes off or lands."""
        flies = self.stage is Stage.FLYING and body is controlled_body(view)
        return self.in_flight.floor(view) if flies else -math.inf

    # Where to go now

    def target(self, view: VehicleView, setpoint: Setpoint | Attitude | None, last: Target) -> Target:
        """Off the ground: what to do now. `setpoint`: by client or pilot; `last`: the target before."""
        if self.hover.body is Body.LOAD and not view.load_attached:
            self.in_flight.without_load()
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
            self.in_flight.start(self._pilot.mode)
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
            return self._descend(self._descent, view, last) if self._descent else self.in_flight.hold()
        if not isinstance(setpoint, Attitude):
            return self.in_flight.target(view, setpoint)
        if mode is not Mode.OFFBOARD or self.in_flight.pattern is not None:
            return self.in_flight.target(view, None)
        if view.vehicle_on_ground and not self.lifts(setpoint):
            self.stage = Stage.GROUND
            self.landed_at = view.time
            return Idle(True)
        return setpoint

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
