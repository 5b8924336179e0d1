"""What goes wrong in flight, and what is done about it: docs/failsafes.md says the same in words."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple, Protocol

from controller.ground.fence import Fence
from controller.ground.parameters import Parameters
from controller.ground.preconditions import tilt
from controller.ground.verdict import CRITICAL, EMERGENCY, WARNING
from controller.ground.view import VehicleView


class Reaction(IntEnum):
    """In the order of severity: a milder one never takes the place of a harder one."""

    NONE = 0
    HOLD = 1
    RETURN = 2
    LAND = 3
    TERMINATE = 4


class Trigger(NamedTuple):
    """A condition that has just come up."""

    reaction: Reaction
    severity: int
    text: str


_LINK = {1: Reaction.HOLD, 2: Reaction.RETURN, 3: Reaction.LAND, 5: Reaction.TERMINATE}
_FENCE = {2: Reaction.HOLD, 3: Reaction.RETURN, 4: Reaction.TERMINATE, 5: Reaction.LAND}
_OFFBOARD = {3: Reaction.RETURN, 4: Reaction.LAND, 5: Reaction.HOLD, 6: Reaction.TERMINATE}


class Situation(NamedTuple):
    """What the failsafes look at besides the view."""

    offboard: bool
    """In offboard mode"""
    setpoint_fresh: bool
    last_station: float | None
    """When a ground station was last heard, if ever"""
    armed_at: float


class Failsafes:
    """Remembers which conditions hold, so that each is reacted to once, when it comes up."""

    def __init__(self) -> None:
        self.active: set[str] = set()

    def reset(self) -> None:
        """Forget everything (disarmed)."""
        self.active.clear()

    def check(
        self, view: VehicleView, now: float, situation: Situation, parameters: Parameters, fence: Fence
    ) -> list[Trigger]:
        """Conditions that have come up (or, for the link to the plant, gone) since the last call."""
        triggers: list[Trigger] = []

        def edge(name: str, holds: bool, trigger: Trigger) -> None:
            if holds and name not in self.active:
                triggers.append(trigger)
            (self.active.add if holds else self.active.discard)(name)

        p = parameters
        was_lost = "hil" in self.active
        lost = view.hil_age > p["COM_HIL_LOSS_T"]
        terminate = Reaction.TERMINATE if p.integer("COM_HIL_LOSS_ACT") == 4 else Reaction.NONE
        text = f"No sensor data for {view.hil_age:.1f} s: link to the plant lost"
        edge("hil", lost, Trigger(terminate, CRITICAL, text))
        if was_lost and not lost:
            back = Reaction.HOLD if p.integer("COM_HIL_LOSS_ACT") == 1 else Reaction.NONE
            triggers.append(Trigger(back, WARNING, "Sensor data are back"))
        if lost:
            return triggers

        failed = not view.in_reach or not tilt(view) <= math.radians(p["FD_FAIL_TILT"])
        edge(
            "flight",
            failed,
            Trigger(Reaction.TERMINATE, EMERGENCY, "Flight failed (FD_FAIL_TILT): rotors stopped"),
        )
        blind = not (view.health.attitude and view.health.position)
        edge("estimate", blind, Trigger(Reaction.LAND, CRITICAL, "Position estimate lost: landing"))
        self._battery(view, p, edge)

        reaction = _OFFBOARD[p.integer("COM_OBL_RC_ACT")]
        text = f"No offboard set-point for {p['COM_OF_LOSS_T']:g} s: {_word(reaction)}"
        edge(
            "offboard", situation.offboard and not situation.setpoint_fresh, Trigger(reaction, WARNING, text)
        )

        heard = situation.last_station
        gone = (
            heard is not None
            and heard >= situation.armed_at - p["COM_DL_LOSS_T"]
            and now - heard > p["COM_DL_LOSS_T"]
        )
        reaction = _LINK.get(p.integer("NAV_DLL_ACT"), Reaction.NONE)
        text = f"No ground station for {p['COM_DL_LOSS_T']:g} s: {_word(reaction)}"
        edge("station", gone and p.integer("NAV_DLL_ACT") != 0, Trigger(reaction, WARNING, text))

        outside = fence.outside(view.position)
        reaction = _FENCE.get(p.integer("GF_ACTION"), Reaction.NONE)
        text = f"Vehicle {outside}: {_word(reaction)}"
        edge("fence", bool(outside) and p.integer("GF_ACTION") != 0, Trigger(reaction, CRITICAL, text))
        return triggers

    def _battery(self, view: VehicleView, p: Parameters, edge: _Edge) -> None:
        left, action = view.battery_remaining, p.integer("COM_LOW_BAT_ACT")
        level = f"Battery at {100 * left:.0f} %: "
        edge(
            "battery low", left < p["BAT_LOW_THR"], Trigger(Reaction.NONE, WARNING, level + "low, land soon")
        )
        reaction = {2: Reaction.LAND, 3: Reaction.RETURN}.get(action, Reaction.NONE)
        text = level + f"critical, {_word(reaction)}"
        edge("battery critical", left < p["BAT_CRIT_THR"], Trigger(reaction, CRITICAL, text))
        reaction = Reaction.LAND if action in (2, 3) else Reaction.NONE
        text = level + f"emergency, {_word(reaction)}"
        edge("battery emergency", left < p["BAT_EMERGEN_THR"], Trigger(reaction, EMERGENCY, text))


class _Edge(Protocol):
    """A function (name, holds, trigger)."""

    def __call__(self, name: str, holds: bool, trigger: Trigger) -> None: ...


def _word(reaction: Reaction) -> str:
    return {
        Reaction.NONE: "warning only",
        Reaction.HOLD: "holding",
        Reaction.RETURN: "returning",
        Reaction.LAND: "landing",
        Reaction.TERMINATE: "rotors stopped",
    }[reaction]
