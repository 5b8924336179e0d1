"""What clients ask of a vehicle, judged: done at once, or denied with a reason and a way out."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from controller.ground.commands.result import (
    INFO,
    OK,
    UNSUPPORTED,
    WARNING,
    Verdict,
    deny,
    not_now,
)
from controller.ground.flight import plans, steering
from controller.ground.flight.guidance import Stage
from controller.ground.flight.motion.geometry import filled, hanging_load, limited_speed
from controller.ground.flight.motion.patterns import Orbit, Pattern
from controller.ground.flight.payload.payload import DELIVER
from controller.ground.flight.px4_modes import BY_STICKS, Mode
from controller.ground.missions import mission_plan as plan
from controller.ground.missions.item_types import WAYPOINT
from controller.ground.missions.mission_plan import Fault, Item
from sitl_bridge.frames import Triple

if TYPE_CHECKING:
    from controller.ground.flight.modes import Machine


class Reposition(NamedTuple):
    """Where to go in HOLD, m and rad ENU; NaN: as it is."""

    of_load: bool
    position: Triple
    yaw: float
    speed: float
    """m/s"""


def set_mode(machine: Machine, mode: Mode, now: float) -> Verdict:
    """Change the mode, now if flying, else as what will happen after arming."""
    if machine.terminated:
        return deny("Mode denied: the flight was terminated; disarm first")
    if mode is Mode.MISSION and not machine.mission.items:
        return deny("Mission denied: there is none; upload one first")
    if mode is Mode.MISSION and (fault := plans.check(machine, machine.mission.items)) is not None:
        return deny(f"Mission denied: {fault.text}")
    if mode is Mode.OFFBOARD and not steering.setpoint_fresh(machine, now):
        return not_now("Offboard denied: no set-points; send them at 2 Hz or more first")
    if mode in BY_STICKS and not steering.sticks_fresh(machine, now):
        return not_now(f"{mode.title} denied: no sticks; send MANUAL_CONTROL first")
    if mode is Mode.LAND and not machine.profile.has_ground:
        return deny("Landing denied: this vehicle has no ground under it; use Hold")
    if mode is Mode.TAKEOFF:
        return takeoff(machine, math.nan)
    machine.enter(mode)
    return OK


def takeoff(machine: Machine, altitude: float) -> Verdict:
    """Take off, now or when armed, to a height of the vehicle, m ENU; NaN: by MIS_TAKEOFF_ALT."""
    if machine.terminated:
        return deny("Take-off denied: the flight was terminated; disarm first")
    if machine.flying and machine.stage is not Stage.ASCENT and not machine.guidance.load_is_down:
        return not_now("Take-off denied: already flying; send a point to go to instead")
    fence = machine.fence
    if fence is None or machine.view is None:
        return not_now("Take-off denied: no position yet; start the plant")
    if math.isinf(altitude):
        return deny("Take-off denied: the altitude is infinite")
    if not math.isnan(altitude) and altitude <= fence.home[2]:
        below = fence.home[2] - altitude
        machine.say(
            WARNING, f"Take-off altitude is {below:.1f} m below home (it is above mean sea level): raised"
        )
    height = machine.guidance.height_of_takeoff(altitude, machine.view)
    fault = fence.outside((fence.home[0], fence.home[1], height))
    if fault:
        return deny(f"Take-off denied: {fault}")
    machine.enter(Mode.TAKEOFF)
    machine.guidance.ask_takeoff_height(altitude, machine.view)
    return OK


def reposition(machine: Machine, where: Reposition, change_mode: bool) -> Verdict:
    """Go to a point and hold there; what is NaN stays as it is."""
    view = machine.view
    if machine.terminated:
        return deny("Reposition denied: the flight was terminated; disarm first")
    if view is None or not machine.flies_soon:
        return not_now("Reposition denied: not flying; take off first")
    if not change_mode and machine.mode is not Mode.HOLD:
        return not_now(f"Reposition denied: in {machine.mode.title}; ask for a change of mode (param2 = 1)")
    if any(math.isinf(x) for x in (*where.position, where.yaw)):
        return deny("Reposition denied: position or heading is infinite")
    here = hanging_load(view, machine.profile) if where.of_load else view.position
    vehicle = machine.vehicle_point(filled(where.position, here), where.of_load)
    stays = all(math.isnan(x) for x in where.position)
    fence = machine.fence
    if fence is not None and not stays:
        if fault := fence.outside(vehicle):
            return deny(f"Reposition denied: {fault}")
        if fault := fence.too_low(vehicle):
            machine.say(WARNING, f"Reposition limited: {fault}")
            vehicle = fence.raised(vehicle)
    if machine.stage is Stage.GROUND:
        machine.guidance.take_off(view)  # before the mode changes: it is what the take-off was asked for
    machine.enter(Mode.HOLD)
    speed = limited_speed(where.speed, machine.parameters)
    machine.guidance.go_to(None if stays else vehicle, where.yaw, speed, view)
    if machine.stage is not Stage.FLYING and not stays:
        machine.say(INFO, "Reposition accepted: after take-off")
    return OK


def fly_pattern(machine: Machine, pattern: Pattern) -> Verdict:
    """Fly an orbit, or a figure of eight in Hold, when the load hangs clear of the ground."""
    name = "Orbit" if isinstance(pattern, Orbit) else "Figure eight"
    fence = machine.fence
    if machine.terminated:
        return deny(f"{name} denied: the flight was terminated; disarm first")
    if fence is None or machine.view is None or not machine.flies_soon:
        return not_now(f"{name} denied: not flying; take off first")
    for point in pattern.extent():
        if fault := fence.outside(point):
            return deny(f"{name} denied: {fault}")
    if fault := fence.too_low(pattern.centre):
        machine.say(WARNING, f"{name} limited: {fault}")
        pattern.centre = fence.raised(pattern.centre)
    if machine.stage is Stage.GROUND:
        machine.guidance.take_off(machine.view)
    machine.enter(Mode.ORBIT if isinstance(pattern, Orbit) else Mode.HOLD)
    machine.guidance.in_flight.pattern = pattern
    return OK


def look_at(machine: Machine, place: Triple | None, next_waypoint: bool = False) -> Verdict:
    """Point the yaw at a place (m ENU) or the next way-point, in Hold and missions; None: at neither."""
    machine.mission.region.look_at(place, next_waypoint)
    machine.guidance.in_flight.looks_at = place
    return OK


def start_mission(machine: Machine, now: float) -> Verdict:
    """Fly the mission, and arm for it, as PX4 does."""
    before = machine.mode
    verdict = set_mode(machine, Mode.MISSION, now)
    if not verdict.ok or machine.armed:
        return verdict
    verdict = machine.arm(now)
    if not verdict.ok:
        machine.set_mode_to(before)  # not to fly at an arming that is meant otherwise
    return verdict


def go_to_item(machine: Machine, item: Item, only_height: bool) -> Fault | None:
    """Fly to a way-point that is no part of a plan, or to its height only."""
    fault = plan.check((item,), machine.profile, machine.home_geodetic(), machine.guidance.fence())
    if fault is not None:
        return Fault(fault.result, f"Reposition denied: {fault.text}")
    if item.command != WAYPOINT:
        return Fault(2, f"Reposition denied: command {item.command} is not a way-point")  # UNSUPPORTED
    x, y, z = plan.place(item, machine.profile.origin, machine.home_geodetic())
    point = (math.nan, math.nan, z) if only_height else (x, y, z)
    verdict = reposition(machine, Reposition(False, point, math.nan, math.nan), True)
    return None if verdict.ok else Fault(14, verdict.text)  # MAV_MISSION_DENIED


def change_speed(machine: Machine, speed: float) -> Verdict:
    """Largest horizontal speed until the mode changes, m/s; -1: the default."""
    largest = machine.parameters["MPC_XY_VEL_MAX"]
    if speed != -1 and not 0 < speed <= largest:
        return deny(
            f"Speed {speed:g} m/s denied: use up to {largest:g} (MPC_XY_VEL_MAX), or -1 for the default"
        )
    machine.guidance.hover.speed = machine.mission.speed = math.nan if speed == -1 else speed
    return OK


def grip(machine: Machine, action: int) -> Verdict:
    """Release (0) or grab (1) the load; done when the outputs are live and the hook is within reach."""
    if machine.payload.gripper is None:
        return Verdict(UNSUPPORTED, "Gripper denied: this vehicle has none; see [gripper] in its file")
    machine.payload.gripper.act(action)
    return OK


def reel(machine: Machine, action: float, length: float, rate: float) -> Verdict:
    """DO_WINCH; length (m) and rate (m/s) pay out. A delivery begins in Hold."""
    if action == DELIVER and machine.payload.delivers:
        if machine.payload.delivering:
            return OK
        if machine.stage is not Stage.FLYING or machine.view is None:
            return not_now("Delivery denied: not flying with the load; take off first")
        fault = machine.payload.delivery_fault(machine.view)
        if fault:
            return deny(f"Delivery denied: {fault}")
        machine.enter(Mode.HOLD)
    return machine.payload.work_winch(action, length, rate, machine.view)
