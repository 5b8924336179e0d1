"""Plans that clients upload: mission, geofence and rally points, taken or refused with a reason."""

from __future__ import annotations

from typing import TYPE_CHECKING

from controller.ground.commands.result import (
    FAILED,
    INFO,
    OK,
    WARNING,
    Verdict,
)
from controller.ground.flight.px4_modes import Mode
from controller.ground.missions import mission_plan as plan
from controller.ground.missions.legs import crossed_zones
from controller.ground.missions.mission_plan import Fault, Item
from controller.ground.missions.plan_id import plan_id
from controller.ground.missions.zones import rally_points_of, zones_of

if TYPE_CHECKING:
    from controller.ground.flight.modes import Machine

_MOST_WARNINGS = 5
"""Of zones that one plan crosses"""


def check(machine: Machine, items: tuple[Item, ...]) -> Fault | None:
    """The first fault of a plan."""
    return plan.check(items, machine.profile, machine.home_geodetic(), machine.guidance.fence())


def accept_mission(machine: Machine, items: tuple[Item, ...]) -> Fault | None:
    """Take a plan, or say why not."""
    fault = check(machine, items)
    if fault is not None:
        return fault
    for text in plan.remarks(items, machine.profile, machine.home_geodetic(), machine.guidance.fence()):
        machine.say(INFO, text)
    _warn_of_zones(machine, items)
    machine.mission.replace(items)
    machine.plan_ids = (plan_id(items), *machine.plan_ids[1:])
    if machine.armed and machine.mode is Mode.MISSION:
        if items:
            machine.mission.start()
            machine.say(INFO, "Mission replaced: flying the new one from its beginning")
        else:
            machine.say(INFO, "Mission cleared in flight; holding")
            machine.enter(Mode.HOLD)
    return None


def accept_fence(machine: Machine, items: tuple[Item, ...]) -> Fault | None:
    """Take a geofence, or say why not."""
    zones = zones_of(items, machine.profile.origin)
    if isinstance(zones, Fault):
        return zones
    machine.guidance.zones = zones
    machine.plan_ids = (machine.plan_ids[0], plan_id(items), machine.plan_ids[2])
    _warn_of_zones(machine, machine.mission.items)
    return None


def accept_rally(machine: Machine, items: tuple[Item, ...]) -> Fault | None:
    """Take rally points, or say why not."""
    points = rally_points_of(items, machine.profile.origin)
    if isinstance(points, Fault):
        return points
    machine.guidance.in_flight.rally_points = points
    machine.plan_ids = (*machine.plan_ids[:2], plan_id(items))
    return None


def set_current_item(machine: Machine, seq: int, reset: bool = False) -> Verdict:
    """Go on with another item of the plan, -1: the current one; `reset`: every jump counts afresh."""
    if reset and 0 <= max(seq, 0) < len(machine.mission.items):
        machine.mission.restart(machine.mission.current)
    fault = "" if seq == -1 and machine.mission.items else machine.mission.jump(seq)
    return Verdict(FAILED, fault) if fault else OK


def _warn_of_zones(machine: Machine, items: tuple[Item, ...]) -> None:
    """Say which ways of a plan cross an exclusion zone."""
    guidance, home = machine.guidance, machine.home_geodetic()
    texts = crossed_zones(items, machine.profile.origin, home, guidance.fence(), guidance.zones)
    for text in texts[:_MOST_WARNINGS]:
        machine.say(WARNING, text)
