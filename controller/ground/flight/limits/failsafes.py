"""What goes wrong in flight, and what is done about it: docs/failsafes.md says the same in words."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

from controller.ground.commands.result import CRITICAL, EMERGENCY, WARNING
from controller.ground.flight.limits.fence import Fence
from controller.ground.flight.limits.preconditions import tilt
from controller.ground.flight.motion.sticks import JOYSTICK
from controller.ground.flight.px4_modes import Mode
from controller.ground.parameters.protocol import Parameters
from controller.ground.telemetry.vehicle_state import VehicleView


class Reaction(IntEnum):
    """In the order of severity: a milder one never takes the place of a harder one."""

    NONE = 0
    HOLD = 1
    RETURN = 2
    LAND = 3
    TERMINATE = 4
    DISARM = 5


class Trigger(NamedTuple):
    """A condition that has just come up."""

    reaction: Reaction
    severity: int
    text: str
    to_sticks: Mode | None = None
    """The mode to go over to instead, if a pilot has the sticks"""


_LINK = {1: Reaction.HOLD, 2: Reaction.RETURN, 3: Reaction.LAND, 5: Reaction.TERMINATE, 6: Reaction.DISARM}
_FENCE = {2: Reaction.HOLD, 3: Reaction.RETURN, 4: Reaction.TERMINATE, 5: Reaction.LAND}
_STOPPING = (Reaction.HOLD, Reaction.RETURN, Reaction.LAND)
"""What is done at the fence already; a warning or a termination waits until it is left"""
_OFFBOARD_TO_STICKS = {0: Mode.POSITION, 1: Mode.ALTITUDE}
_EXCEPTIONS = {Mode.MISSION: 1, Mode.HOLD: 2, Mode.TAKEOFF: 2, Mode.OFFBOARD: 4}
"""Bits of COM_RCL_EXCEPT"""
_OFFBOARD = {
    0: Reaction.HOLD,
    1: Reaction.HOLD,
    2: Reaction.HOLD,
    3: Reaction.RETURN,
    4: Reaction.LAND,
    5: Reaction.HOLD,
    6: Reaction.TERMINATE,
    7: Reaction.DISARM,
}


class Situation(NamedTuple):
    """What the failsafes look at besides the view."""

    mode: Mode
    setpoint_fresh: bool
    """Of an offboard client"""
    last_sticks: float
    """When a pilot's sticks were last heard; -inf: never"""
    last_station: float | None
    """When a ground station was last heard, if ever"""
    armed_at: float


SLOW_CHECKS = 0.1
"""s between two looks at battery, ground stations and geofence"""


class Failsafes:
    """Remembers which conditions hold, so that each is reacted to once, when it comes up."""

    def __init__(self) -> None:
        self.active: set[str] = set()
        self._next_slow = -math.inf

    def reset(self) -> None:
        """Forget everything (disarmed)."""
        self.active.clear()
        self._next_slow = -math.inf

    def check(
        self, view: VehicleView, now: float, situation: Situation, p: Parameters, fence: Fence
    ) -> list[Trigger]:
        """Conditions that have come up (or, for the link to the plant, gone) since the last call."""
        lost = view.hil_age > p["COM_HIL_LOSS_T"]
        if lost != ("hil" in self.active):
            self._note("hil", lost)
            return [_link_to_plant(view, p, lost)]
        if lost:
            return []
        fast = (
            ("flight", not (view.in_reach and tilt(view) <= math.radians(p["FD_FAIL_TILT"]))),
            ("estimate", not (view.health.attitude and view.health.position)),
            ("sticks", _without_sticks(now, situation, p)),
            ("offboard", situation.mode is Mode.OFFBOARD and not situation.setpoint_fresh),
        )
        conditions: tuple[tuple[str, bool], ...] = fast
        if now >= self._next_slow:
            self._next_slow = now + SLOW_CHECKS
            conditions = (*fast, *_slow(view, now, situation, p, fence))
        triggers = []
        for name, holds in conditions:
            if holds != (name in self.active):
                self._note(name, holds)
                if holds:
                    triggers.append(_REACTIONS[name](view, p, fence))
        return triggers

    def _note(self, name: str, holds: bool) -> None:
        (self.active.add if holds else self.active.discard)(name)


def _slow(
    view: VehicleView, now: float, situation: Situation, p: Parameters, fence: Fence
) -> tuple[tuple[str, bool], ...]:
    left, heard, timeout = view.battery_remaining, situation.last_station, p["COM_DL_LOSS_T"]
    # A station that was lost before arming is no loss: this flight was begun without it.
    gone = heard is not None and heard >= situation.armed_at - timeout and now - heard > timeout
    return (
        ("battery low", left < p["BAT_LOW_THR"]),
        ("battery critical", left < p["BAT_CRIT_THR"]),
        ("battery emergency", left < p["BAT_EMERGEN_THR"]),
        ("inertial", view.health.wrong != ""),
        ("station", gone and p.integer("NAV_DLL_ACT") != 0),
        ("fence", p.integer("GF_ACTION") != 0 and bool(_outside(view, p, fence))),
    )


def _link_to_plant(view: VehicleView, p: Parameters, lost: bool) -> Trigger:
    action = p.integer("COM_HIL_LOSS_ACT")
    if lost:
        reaction = Reaction.TERMINATE if action == 4 else Reaction.NONE
        return Trigger(reaction, CRITICAL, f"No sensor data for {view.hil_age:.1f} s: link to the plant lost")
    return Trigger(Reaction.HOLD if action == 1 else Reaction.NONE, WARNING, "Sensor data are back")


def _flight(view: VehicleView, p: Parameters, fence: Fence) -> Trigger:
    return Trigger(Reaction.TERMINATE, EMERGENCY, "Flight failed (FD_FAIL_TILT): rotors stopped")


def _estimate(view: VehicleView, p: Parameters, fence: Fence) -> Trigger:
    return Trigger(Reaction.LAND, CRITICAL, "Position estimate lost: landing")


def _inertial(view: VehicleView, p: Parameters, fence: Fence) -> Trigger:
    return Trigger(Reaction.LAND, CRITICAL, f"{view.health.wrong.capitalize()} wrong: landing")


def _offboard(view: VehicleView, p: Parameters, fence: Fence) -> Trigger:
    action = p.integer("COM_OBL_RC_ACT")
    reaction = _OFFBOARD[action]
    text = f"No offboard set-point for {p['COM_OF_LOSS_T']:g} s: {_word(reaction)}"
    return Trigger(reaction, WARNING, text, _OFFBOARD_TO_STICKS.get(action))


def _without_sticks(now: float, situation: Situation, p: Parameters) -> bool:
    """Whether a pilot's sticks are lost where they count: in their own modes, and in others as on PX4."""
    timeout = p["COM_RC_LOSS_T"]
    # A pilot who was lost before arming is no loss: this flight was begun without sticks.
    since = max(situation.armed_at - timeout, -1e300)
    if now - situation.last_sticks <= timeout or situation.last_sticks < since:
        return False
    bit = _EXCEPTIONS.get(situation.mode, 0)
    return p.integer("COM_RC_IN_MODE") in JOYSTICK and not p.integer("COM_RCL_EXCEPT") & bit


def _sticks(view: VehicleView, p: Parameters, fence: Fence) -> Trigger:
    reaction = _LINK[p.integer("NAV_RCL_ACT")]
    return Trigger(reaction, WARNING, f"No sticks for {p['COM_RC_LOSS_T']:g} s: {_word(reaction)}")


def _station(view: VehicleView, p: Parameters, fence: Fence) -> Trigger:
    reaction = _LINK.get(p.integer("NAV_DLL_ACT"), Reaction.NONE)
    return Trigger(reaction, WARNING, f"No ground station for {p['COM_DL_LOSS_T']:g} s: {_word(reaction)}")


def _outside(view: VehicleView, p: Parameters, fence: Fence) -> str:
    """Which body is outside the geofence, or will be, and how; empty if none is."""
    if fault := fence.outside(view.position):
        return f"Vehicle {fault}"
    fault = fence.outside(view.load_position) if view.load_attached else ""
    if fault:
        return f"Load {fault}"
    stops = _FENCE.get(p.integer("GF_ACTION")) in _STOPPING
    return f"Geofence ahead: {fence.ahead}" if fence.ahead and stops else ""


def _geofence(view: VehicleView, p: Parameters, fence: Fence) -> Trigger:
    reaction = _FENCE.get(p.integer("GF_ACTION"), Reaction.NONE)
    return Trigger(reaction, CRITICAL, f"{_outside(view, p, fence)}: {_word(reaction)}")


def _battery(severity: int, word: str, reactions: dict[int, Reaction]) -> _Maker:
    def make(view: VehicleView, p: Parameters, fence: Fence) -> Trigger:
        reaction = reactions.get(p.integer("COM_LOW_BAT_ACT"), Reaction.NONE)
        text = f"Battery at {100 * view.battery_remaining:.0f} %: {word}, {_word(reaction)}"
        return Trigger(reaction, severity, text)

    return make


_Maker = Callable[[VehicleView, Parameters, Fence], Trigger]
_REACTIONS: dict[str, _Maker] = {
    "flight": _flight,
    "estimate": _estimate,
    "inertial": _inertial,
    "offboard": _offboard,
    "sticks": _sticks,
    "station": _station,
    "fence": _geofence,
    "battery low": _battery(WARNING, "low", {}),
    "battery critical": _battery(CRITICAL, "critical", {2: Reaction.LAND, 3: Reaction.RETURN}),
    "battery emergency": _battery(EMERGENCY, "emergency", {2: Reaction.LAND, 3: Reaction.LAND}),
}


def _word(reaction: Reaction) -> str:
    return {
        Reaction.NONE: "warning only",
        Reaction.HOLD: "holding",
        Reaction.RETURN: "returning",
        Reaction.LAND: "landing",
        Reaction.TERMINATE: "rotors stopped",
        Reaction.DISARM: "disarming",
    }[reaction]
