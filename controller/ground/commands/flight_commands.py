"""Commands that fly: arm, modes, points, patterns, missions, and what hangs below."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.commands.command import Command, Handler, Requests
from controller.ground.commands.result import OK, Verdict, deny, not_now
from controller.ground.flight import client_requests, plans
from controller.ground.flight.client_requests import Reposition
from controller.ground.flight.guidance import Stage
from controller.ground.flight.modes import Machine
from controller.ground.flight.motion.geometry import filled
from controller.ground.flight.motion.patterns import LARGEST_RADIUS, FigureEight, Orbit, Yaw
from controller.ground.flight.motion.region_of_interest import ITEM, LOCATION, NEXT, kind_of
from controller.ground.flight.payload.gripper import GRIPPER_ACTIONS, HOLD
from controller.ground.flight.px4_modes import Mode, find_mode, find_standard_mode
from controller.ground.missions import mission_plan as plan
from controller.ground.missions.mission_plan import RELATIVE_FRAMES
from sitl_bridge.frames import Geodetic, Triple, yaw_from_heading
from sitl_bridge.ids import COMPONENT_LOAD

FORCE = 21196.0
"""param2 of an arm or disarm command that is meant in any case"""
DEFAULT_RADIUS = 10.0
"""m, of an orbit or figure of eight that says none"""
_CUSTOM_MODE_ENABLED = 1
_MODES_BY_FLAGS = (
    (mavlink.MAV_MODE_FLAG_AUTO_ENABLED, Mode.MISSION),
    (mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED, Mode.POSITION),
)
"""As PX4 reads a base mode without a custom one"""
_CANCELLED = 6
"""MAV_RESULT_CANCELLED of the current `common` dialect"""


def arm(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """COMPONENT_ARM_DISARM."""
    if c.p1 not in (0.0, 1.0):
        return deny(f"Arm or disarm denied: param1 is {c.p1:g}; use 1 or 0")
    # A forced arm is an ordinary one: nothing that keeps this vehicle on the ground can be waived safely.
    return machine.arm(now) if c.p1 == 1.0 else machine.disarm(c.p2 == FORCE)


def takeoff(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """NAV_TAKEOFF."""
    return client_requests.takeoff(machine, _height(c, machine))


def set_mode(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_SET_MODE."""
    # MAVSDK and QGroundControl set other bits of the base mode too; only this one says that 2 and 3 count.
    if not (0 <= c.p1 <= 255 and c.p1 == int(c.p1)):
        return deny(f"Mode denied: param1 is {c.p1:g}; use 1 (custom mode) with PX4's main and sub mode")
    if not int(c.p1) & _CUSTOM_MODE_ENABLED:
        by_flags = next((m for flags, m in _MODES_BY_FLAGS if int(c.p1) & flags == flags), None)
        if by_flags is None:
            return deny(f"Mode denied: no mode has the flags {c.p1:g}; use 1 with PX4's main and sub mode")
        if by_flags is Mode.MISSION and not (machine.mission.items or machine.armed):
            # DroneKit's scripts for PX4 ask for AUTO before they upload; PX4 takes any mode while disarmed.
            machine.enter(by_flags)
            return OK
        return client_requests.set_mode(machine, by_flags, now)
    numbers = [0.0 if math.isnan(p) else p for p in (c.p2, c.p3)]
    if not all(math.isfinite(number) for number in numbers):
        return deny("Mode denied: the mode is infinite")
    found = find_mode(*numbers)
    return deny(found) if isinstance(found, str) else client_requests.set_mode(machine, found, now)


def set_standard_mode(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_SET_STANDARD_MODE."""
    if not math.isfinite(c.p1):
        return deny("Mode denied: the mode is not finite")
    found = find_standard_mode(c.p1)
    return deny(found) if isinstance(found, str) else client_requests.set_mode(machine, found, now)


def mode(mode: Mode) -> Handler:
    """A command that asks for a mode."""
    return lambda c, machine, requests, now: client_requests.set_mode(machine, mode, now)


def reposition(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_REPOSITION."""
    if math.isnan(c.p5) != math.isnan(c.p6):
        return deny("Reposition denied: latitude without longitude; send both or neither")
    if abs(c.p5) > 90 or abs(c.p6) > 180:
        return deny(f"Reposition denied: {c.p5:g}, {c.p6:g} is not a valid position; use degrees")
    home = machine.profile.origin.home
    east, north, _ = machine.profile.origin.local(Geodetic(c.p5, c.p6, home.altitude))
    yaw = math.nan if math.isnan(c.p4) else yaw_from_heading(c.p4) if math.isfinite(c.p4) else c.p4
    speed = c.p1 if c.p1 > 0 else math.nan
    where = Reposition(c.component == COMPONENT_LOAD, (east, north, _height(c, machine)), yaw, speed)
    return client_requests.reposition(machine, where, c.p2 == 1.0)


def change_altitude(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_CHANGE_ALTITUDE: param1 in the frame of param2, above mean sea level without one, as on PX4."""
    relative = c.p2 in RELATIVE_FRAMES
    up = _height(c._replace(p7=c.p1, relative=relative), machine)
    where = Reposition(False, (math.nan, math.nan, up), math.nan, math.nan)
    return client_requests.reposition(machine, where, change_mode=True)


def orbit(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_ORBIT."""
    centre = _centre(c, machine, "Orbit")
    if isinstance(centre, Verdict):
        return centre
    if math.isinf(c.p1) or math.isinf(c.p2) or math.isinf(c.p4):
        return deny("Orbit denied: radius, speed or turns are infinite")
    radius = _or(c.p1, DEFAULT_RADIUS)
    speed = _or(c.p2, machine.parameters["MPC_XY_CRUISE"])
    kind = 0.0 if math.isnan(c.p3) else c.p3
    if kind not in tuple(Yaw) or radius == 0.0 or speed == 0.0:
        return deny(f"Orbit denied: radius {radius:g} m, speed {speed:g} m/s, heading {kind:g}; see DO_ORBIT")
    most = machine.parameters["MPC_XY_VEL_MAX"]
    orbit = Orbit(centre, radius, math.copysign(min(abs(speed), most), speed), Yaw(int(kind)), _or(c.p4, 0.0))
    verdict = client_requests.fly_pattern(machine, orbit)
    if verdict.ok and orbit.speed < abs(speed) - 0.01:
        requests.say(f"Orbit limited to {orbit.speed:.1f} m/s")
    return verdict


def figure_eight(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_FIGURE_EIGHT."""
    centre = _centre(c, machine, "Figure eight")
    if isinstance(centre, Verdict):
        return centre
    if any(math.isinf(p) for p in (c.p1, c.p2, c.p4)):
        return deny("Figure eight denied: a radius or the orientation is infinite")
    major = _or(c.p1, DEFAULT_RADIUS)
    minor = _or(c.p2, 0.5 * abs(major))
    if not 1.0 <= abs(major) <= LARGEST_RADIUS or not 0.5 <= abs(minor) <= abs(major):
        return deny(f"Figure eight denied: radii {major:g} m and {minor:g} m; from 1 m, the longer first")
    speed = machine.parameters["MPC_XY_CRUISE"]
    return client_requests.fly_pattern(
        machine, FigureEight(centre, major, minor, yaw_from_heading(_or(c.p4, 0.0)), speed)
    )


def _centre(c: Command, machine: Machine, name: str) -> Triple | Verdict:
    """Of a pattern, m ENU of the vehicle; what is NaN is where the vehicle is."""
    if math.isnan(c.p5) != math.isnan(c.p6):
        return deny(f"{name} denied: latitude without longitude; send both or neither")
    if abs(c.p5) > 90 or abs(c.p6) > 180 or math.isinf(c.p7):
        return deny(f"{name} denied: {c.p5:g}, {c.p6:g}, {c.p7:g} is not a valid position; use degrees")
    if machine.view is None:
        return not_now(f"{name} denied: no position yet; start the plant")
    home = machine.profile.origin.home
    east, north, _ = machine.profile.origin.local(Geodetic(c.p5, c.p6, home.altitude))
    here = machine.view.position
    # PX4 reads the altitude above mean sea level in any frame, and MAVSDK sends it so in a relative one.
    readings = (_height(c, machine), c.p7 - home.altitude)
    return filled((east, north, min(readings, key=lambda z: abs(z - here[2]))), here)


def _or(value: float, default: float) -> float:
    return default if math.isnan(value) else value


def gripper(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_GRIPPER."""
    if c.p2 not in GRIPPER_ACTIONS:
        return deny(f"Gripper denied: action {c.p2:g}; use 0 (release), 1 (grab) or 2 (hold)")
    return (
        OK
        if c.p2 == HOLD and machine.payload.gripper is not None
        else client_requests.grip(machine, int(c.p2))
    )


def winch(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_WINCH."""
    return client_requests.reel(machine, c.p2, c.p3, c.p4)


def pause(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_PAUSE_CONTINUE."""
    if c.p1 == 0.0:
        return client_requests.set_mode(machine, Mode.HOLD, now)
    if c.p1 == 1.0 and machine.mission.items:
        return client_requests.set_mode(machine, Mode.MISSION, now)
    return deny(f"Pause or go on denied: param1 is {c.p1:g}; use 0, or 1 with a mission")


def change_speed(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_CHANGE_SPEED."""
    if c.p1 not in (0.0, 1.0) and not math.isnan(c.p1):
        return deny(
            f"Speed of kind {c.p1:g} cannot be set; use 0 or 1 (horizontal), or MPC_Z_VEL_MAX_UP and _DN"
        )
    return client_requests.change_speed(machine, c.p2)


def mission_start(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """MISSION_START."""
    if c.p1 > 0:
        verdict = set_item(c, machine, requests, now)
        if not verdict.ok:
            return verdict
    known = math.isfinite(
        c.p1
    )  # without an item PX4 denies it; here it is a change of mode, and arms nothing
    if not known and not machine.armed:
        return client_requests.set_mode(machine, Mode.MISSION, now)
    return client_requests.start_mission(machine, now)


def land_start(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_LAND_START: go on with the plan at its landing."""
    marks = [i for i, item in enumerate(machine.mission.items) if item.command == c.number]
    if not marks:
        return Verdict(_CANCELLED, "Landing denied: the mission has no DO_LAND_START; use Land or Return")
    verdict = plans.set_current_item(machine, marks[0])
    return client_requests.start_mission(machine, now) if verdict.ok else verdict


def go_around(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_GO_AROUND: a landing is broken off; without one nothing changes, as on PX4."""
    landing = machine.stage is Stage.DESCENT
    return client_requests.set_mode(machine, Mode.HOLD, now) if landing else OK


def region_of_interest(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_SET_ROI and its kin: where the yaw points."""
    kind = kind_of(c.number, c.p1)
    if kind == LOCATION:
        if not (math.isfinite(c.p5) and math.isfinite(c.p6)):
            return deny("Region of interest denied: no place; send latitude and longitude")
        place = _centre(c, machine, "Region of interest")
        return place if isinstance(place, Verdict) else client_requests.look_at(machine, place)
    if kind == ITEM:
        items = machine.mission.items
        if not (math.isfinite(c.p2) and 0 <= c.p2 < len(items) and items[int(c.p2)].has_place):
            return deny(f"Region of interest denied: mission item {c.p2:g} is no place")
        where = plan.place(items[int(c.p2)], machine.profile.origin, machine.home_geodetic())
        return client_requests.look_at(machine, where)
    return client_requests.look_at(machine, None, next_waypoint=kind == NEXT)


def set_item(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_SET_MISSION_CURRENT, and the item of MISSION_START."""
    if not (math.isfinite(c.p1) and c.p1 == int(c.p1)):
        return deny(f"Mission item {c.p1:g} does not exist; use its number")
    reset = c.number == mavlink.MAV_CMD_DO_SET_MISSION_CURRENT and c.p2 == 1.0
    return plans.set_current_item(machine, int(c.p1), reset)


def set_home(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_SET_HOME."""
    if machine.view is None:
        return not_now("Home denied: no position yet; start the plant")
    if c.p1 == 1.0:
        return machine.set_home_to(machine.view.position)
    if not (abs(c.p5) <= 90 and abs(c.p6) <= 180) or math.isinf(c.p7):
        return deny(
            f"Home denied: {c.p5:g}, {c.p6:g}, {c.p7:g} is not a valid position; use degrees, or param1 = 1"
        )
    east, north, _ = machine.profile.origin.local(Geodetic(c.p5, c.p6, machine.profile.origin.home.altitude))
    return machine.set_home_to((east, north, _height(c, machine)))


def terminate(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_FLIGHTTERMINATION."""
    if c.p1 != 1.0:
        return deny(f"Termination denied: param1 is {c.p1:g}; use 1")
    return machine.terminate()


def _height(c: Command, machine: Machine) -> float:
    """p7 as a height, m ENU; NaN if unset."""
    home = machine.home[2] if machine.home is not None else 0.0
    return home + c.p7 if c.relative else c.p7 - machine.profile.origin.home.altitude
