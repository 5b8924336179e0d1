"""Plan ids, and the messages of the mission protocol that carry them; pymavlink has not got the fields.

A client compares an id with the one that it knows, and so sees whether a plan on board has changed.
"""

from __future__ import annotations

import struct
import zlib
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.missions.mission_plan import Item

_ITEM = struct.Struct("<3i4diid")


def plan_id(items: tuple[Item, ...]) -> int:
    """A number that changes with any item; 0: there is no plan."""
    if not items:
        return 0
    found = 0
    for item in items:
        found = zlib.crc32(_ITEM.pack(*item), found)
    return found or 1


class MissionCurrent(mavlink.MAVLink_mission_current_message):  # type: ignore[misc]
    """MISSION_CURRENT with the ids of mission, geofence and rally points."""

    _layout = struct.Struct("<HHBBIII")

    def __init__(self, seq: int, total: int, state: int, mode: int, ids: tuple[int, int, int]) -> None:
        super().__init__(seq, total, state, mode)
        self._ids = ids

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """As pymavlink's generated messages do."""
        fields = (self.seq, self.total, self.mission_state, self.mission_mode, *self._ids)
        return bytes(self._pack(mav, self.crc_extra, self._layout.pack(*fields), force_mavlink1))


class MissionCount(mavlink.MAVLink_mission_count_message):  # type: ignore[misc]
    """MISSION_COUNT with the id of the plan that is downloaded."""

    _layout = struct.Struct("<HBBBI")

    def __init__(self, system: int, component: int, count: int, kind: int, opaque_id: int) -> None:
        super().__init__(system, component, count, kind)
        self.opaque_id = opaque_id

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """As pymavlink's generated messages do."""
        to = (self.target_system, self.target_component)
        payload = self._layout.pack(self.count, *to, self.mission_type, self.opaque_id)
        return bytes(self._pack(mav, self.crc_extra, payload, force_mavlink1))


class MissionAck(mavlink.MAVLink_mission_ack_message):  # type: ignore[misc]
    """MISSION_ACK with the id of the plan that was uploaded; 0: none was."""

    _layout = struct.Struct("<BBBBI")

    def __init__(self, system: int, component: int, result: int, kind: int, opaque_id: int = 0) -> None:
        super().__init__(system, component, result, kind)
        self.opaque_id = opaque_id

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """As pymavlink's generated messages do."""
        to = (self.target_system, self.target_component)
        payload = self._layout.pack(*to, self.type, self.mission_type, self.opaque_id)
        return bytes(self._pack(mav, self.crc_extra, payload, force_mavlink1))
