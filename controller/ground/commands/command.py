"""A command as COMMAND_LONG and COMMAND_INT both mean it, and what it can ask of other services."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.commands.result import Verdict
from controller.ground.flight.modes import Machine
from controller.ground.missions.item_types import ROI
from sitl_bridge.frames import DEG_E7_PER_DEG

_UNSET_INT = 0x7FFFFFFF


class Command(NamedTuple):
    """A command as both messages mean it; NaN is unset."""

    number: int
    p1: float
    p2: float
    p3: float
    p4: float
    p5: float
    """Degrees of latitude where the command has a place"""
    p6: float
    """Degrees of longitude where the command has a place"""
    p7: float
    relative: bool
    """p7 is above home; else above mean sea level"""
    frame_fault: str
    """Why the frame cannot be used, or an empty string"""
    component: int
    """Whom it is for: autopilot, load or winch"""


WITH_PLACE = frozenset(
    (
        mavlink.MAV_CMD_NAV_TAKEOFF,
        mavlink.MAV_CMD_NAV_LAND,
        mavlink.MAV_CMD_DO_REPOSITION,
        mavlink.MAV_CMD_DO_ORBIT,
        mavlink.MAV_CMD_DO_FIGURE_EIGHT,
        mavlink.MAV_CMD_DO_SET_HOME,
        mavlink.MAV_CMD_DO_SET_ROI_LOCATION,
        *ROI,
        mavlink.MAV_CMD_NAV_LOITER_UNLIM,
        mavlink.MAV_CMD_NAV_WAYPOINT,
    )
)
"""p5 to p7 are a place"""


def command_of(message: Any, component: int) -> Command:
    """The command of a COMMAND_LONG or COMMAND_INT message."""
    p = (message.param1, message.param2, message.param3, message.param4)
    if message.id == mavlink.MAVLINK_MSG_ID_COMMAND_LONG:
        rest = (message.param5, message.param6, message.param7)
        return Command(message.command, *p, *rest, False, "", component)
    scale = DEG_E7_PER_DEG if message.command in WITH_PLACE else 1.0
    x, y = (math.nan if v == _UNSET_INT else v / scale for v in (message.x, message.y))
    relative = message.frame in (
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    )
    absolute = message.frame in (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
    fault = "" if relative or absolute else f"Frame {message.frame} is not supported; use 0, 5 (AMSL), 3 or 6"
    return Command(message.command, *p, x, y, message.z, relative, fault, component)


class Requests(Protocol):
    """What commands can ask of other services; the station fills it in for the peer that asks."""

    def send_message(self, message_id: int, index: float) -> bool:
        """Send one message once; False if there is no such message."""

    def set_interval(self, message_id: float, microseconds: float) -> Verdict:
        """Stream a message at an interval."""

    def send_interval(self, message_id: float) -> None:
        """Send MESSAGE_INTERVAL."""

    def storage(self, action: float) -> Verdict:
        """Load (0), save (1) or reset (2) the parameters."""

    def inject_failure(self, parameters: tuple[float, ...]) -> None:
        """Pass MAV_CMD_INJECT_FAILURE on to the plant; its answer is the command's."""

    def restart(self, shut_down: bool) -> None:
        """Begin afresh, or end, once the acknowledgement is out."""

    def say(self, text: str) -> None:
        """A STATUSTEXT that comes with an acceptance."""


Handler = Callable[[Command, Machine, Requests, float], Verdict | None]
"""Carries a command out at a time, s; None: the verdict comes later"""
