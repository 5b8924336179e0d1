"""Mission, geofence and rally points are downloaded from the autopilot, as a ground station does. No I/O.

Current autopilots say in MISSION_CURRENT an id of each plan, and a new id starts a new download. Without ids
the plans are looked at again every few seconds.
"""

from __future__ import annotations

import math
import struct
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.missions.mission_plan import MOST_ITEMS, Item
from controller.ground.missions.transfer import FENCE, MISSION, RALLY
from sitl_bridge.ids import COMPONENT_AUTOPILOT
from sitl_bridge.mavlink.framing import Frame

KINDS = (MISSION, FENCE, RALLY)
LOOK_INTERVAL = 5.0
"""s between two downloads from an autopilot without ids."""
PATIENCE = 1.0
"""s after which a request without an answer is repeated."""
MOST_REQUESTS = 4
"""For one item; then the download is given up until the next look."""
_CURRENT = struct.Struct("<HHBBIII")
"""MISSION_CURRENT with its three ids, which pymavlink's dialect does not have yet."""


class PlanDownload:
    """One plan after the other, one item after the other; items (n) by MAV_MISSION_TYPE."""

    def __init__(self, system: int, component: int) -> None:
        """system, component: ours."""
        self._us = (system, component)
        self._target: tuple[int, int] | None = None
        self.items: dict[int, tuple[Item, ...]] = dict.fromkeys(KINDS, ())
        """The last whole plan of each kind."""
        self._waiting: list[int] = []
        self._got: list[Item] = []
        self._count: int | None = None
        self._due = math.inf
        self._requests = 0
        self._next_look = math.inf
        self._ids: tuple[int, ...] = (0, 0, 0)

    def begin(self, system: int, now: float) -> None:
        """There is an autopilot: download what it has."""
        self._target = (system, COMPONENT_AUTOPILOT)
        self._look(now)

    def _look(self, now: float) -> None:
        self._waiting, self._count, self._requests, self._due = list(KINDS), None, 0, now
        self._next_look = now + LOOK_INTERVAL

    def current(self, frame: Frame, now: float) -> None:
        """MISSION_CURRENT of the autopilot: with other ids, the plans are others."""
        ids = _CURRENT.unpack(frame.payload[: _CURRENT.size].ljust(_CURRENT.size, b"\0"))[4:]
        if ids != self._ids:
            self._ids = ids
            self._look(now)

    def to_send(self, now: float) -> list[Any]:
        """The messages that are due."""
        if self._target is None:
            return []
        if not self._waiting and now >= self._next_look and not any(self._ids):
            self._look(now)
        if not self._waiting or now < self._due:
            return []
        if self._requests >= MOST_REQUESTS:
            self._waiting = []
            return []
        self._requests += 1
        self._due = now + PATIENCE
        kind = self._waiting[0]
        if self._count is None:
            return [mavlink.MAVLink_mission_request_list_message(*self._target, kind)]
        return [mavlink.MAVLink_mission_request_int_message(*self._target, len(self._got), kind)]

    def next_deadline(self) -> float:
        """When `to_send` has something at the latest."""
        return self._due if self._waiting else self._next_look

    def take(self, message: Any, system: int, now: float) -> bool:
        """MISSION_COUNT or MISSION_ITEM_INT; whether a plan is complete with it."""
        ours = (message.target_system, message.target_component) == self._us
        if self._target is None or system != self._target[0] or not ours or not self._waiting:
            return False
        if message.mission_type != self._waiting[0]:
            return False
        if message.id == mavlink.MAVLINK_MSG_ID_MISSION_COUNT and self._count is None:
            self._count, self._got = min(message.count, MOST_ITEMS), []
        elif self._count is not None and getattr(message, "seq", None) == len(self._got):
            self._got.append(_item(message))
        else:
            return False
        self._requests, self._due = 0, now
        if len(self._got) < self._count:
            return False
        self.items = {**self.items, self._waiting.pop(0): tuple(self._got)}
        self._count = None
        return True


def _item(message: Any) -> Item:
    parameters = (message.param1, message.param2, message.param3, message.param4)
    place = (message.x, message.y, message.z)
    return Item(message.frame, message.command, message.autocontinue, *parameters, *place)
