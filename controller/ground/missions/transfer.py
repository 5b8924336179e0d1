"""The mission protocol: upload, download, clear, for any number of peers at once.

An upload is staged for each peer and takes the plan's place in one step when it is complete and can be flown;
until then, and if it never is, nothing changes. Nobody's MISSION_ACK is waited for.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.link.peers import Address
from controller.ground.missions.item_types import WITH_PLACE
from controller.ground.missions.mission_plan import MOST_ITEMS, Fault, Item
from controller.ground.missions.plan_id import MissionAck, MissionCount, plan_id
from sitl_bridge.frames import DEG_E7_PER_DEG

RETRY_INTERVAL = 0.25
"""s, after which an item that did not come is asked for again"""
PATIENCE = 5.0
"""s without an item, after which an upload is dropped"""
MOST_TRANSFERS = 32
_GO_TO = 2
_CHANGE_HEIGHT = 3
"""Values of an item's `current` in guided flight, as ArduPilot's clients send it"""

MISSION: int = mavlink.MAV_MISSION_TYPE_MISSION
FENCE: int = mavlink.MAV_MISSION_TYPE_FENCE
RALLY: int = mavlink.MAV_MISSION_TYPE_RALLY
_NAMES = {MISSION: "Mission", FENCE: "Geofence", RALLY: "Rally points"}

Reply = Callable[[Any], None]
Say = Callable[[str], None]


class Client(NamedTuple):
    """The other end of a transfer."""

    peer: Address
    system: int
    component: int


@dataclass
class _Upload:
    count: int
    last_item: float
    last_request: float
    items: list[Item] = field(default_factory=list)


class Missions:
    """The plan on board and the transfers under way.

    `accept` judges a complete plan and takes it. `go_to` flies to the item of an older client at once,
    or only changes to its height if the flag is true.
    """

    def __init__(
        self,
        accept: Callable[[tuple[Item, ...]], Fault | None],
        go_to: Callable[[Item, bool], Fault | None],
        kind: int = MISSION,
    ) -> None:
        self._kind = kind
        self._name = _NAMES[kind]
        self.items: tuple[Item, ...] = ()
        self._accept = accept
        self._go_to = go_to
        self._uploads: dict[Client, _Upload] = {}
        self._downloads: dict[Client, tuple[Item, ...]] = {}
        self._finished: dict[Client, tuple[int, int]] = {}
        """What the last upload of a client ended with: (its count, MAV_MISSION_RESULT)."""

    def receive(self, message: Any, client: Client, now: float, reply: Reply, say: Say) -> None:
        """Any MISSION_* message of the transfer protocol."""
        handler = _HANDLERS.get(message.id)
        if handler is not None:
            handler(self, message, client, now, reply, say)

    # Download

    def _request_list(self, message: Any, client: Client, now: float, reply: Reply, say: Say) -> None:
        kind = message.mission_type
        items = self.items
        self._downloads.pop(client, None)
        if len(self._downloads) >= MOST_TRANSFERS:
            del self._downloads[next(iter(self._downloads))]
        self._downloads[client] = items
        reply(MissionCount(client.system, client.component, len(items), kind, plan_id(items)))

    def _request(self, message: Any, client: Client, now: float, reply: Reply, say: Say) -> None:
        kind = message.mission_type
        items = self._downloads.get(client, self.items)
        if message.seq >= len(items):
            say(f"{self._name} item {message.seq} does not exist; there are {len(items)}")
            self._ack(client, mavlink.MAV_MISSION_INVALID_SEQUENCE, kind, reply)
        elif message.id == mavlink.MAVLINK_MSG_ID_MISSION_REQUEST:
            reply(_item_message(items[message.seq], message.seq, client, self._kind))
        else:
            reply(_item_int_message(items[message.seq], message.seq, client, self._kind))

    # Upload

    def _count(self, message: Any, client: Client, now: float, reply: Reply, say: Say) -> None:
        kind = message.mission_type
        self._finished.pop(client, None)
        if message.count > MOST_ITEMS:
            say(f"{self._name} of {message.count} items is too long; at most {MOST_ITEMS}")
            self._ack(client, mavlink.MAV_MISSION_NO_SPACE, kind, reply)
        elif message.count == 0:
            self._uploads.pop(client, None)
            self._finish(client, (), reply, say)
        elif client not in self._uploads and len(self._uploads) >= MOST_TRANSFERS:
            say("Too many mission uploads at once; try again later")
            self._ack(client, mavlink.MAV_MISSION_ERROR, kind, reply)
        else:
            self._uploads[client] = _Upload(message.count, now, now)
            self._ask(client, reply)

    def _item(self, message: Any, client: Client, now: float, reply: Reply, say: Say) -> None:
        if message.current in (_GO_TO, _CHANGE_HEIGHT):
            self._guided(message, client, reply, say)
            return
        upload = self._uploads.get(client)
        if upload is None:
            self._late_item(message.seq, client, reply)
            return
        expected = len(upload.items)
        if message.seq != expected:
            return  # a duplicate, or one that overtook another: the one that is missing has been asked for
        item = _item_of(message)
        if item is None:
            del self._uploads[client]
            say(f"{self._name} item {message.seq}: position is not a number")
            self._ack(client, mavlink.MAV_MISSION_INVALID_PARAM5_X, self._kind, reply)
            return
        upload.items.append(item)
        upload.last_item = upload.last_request = now
        if len(upload.items) < upload.count:
            self._ask(client, reply)
        else:
            del self._uploads[client]
            self._finish(client, tuple(upload.items), reply, say)

    def _guided(self, message: Any, client: Client, reply: Reply, say: Say) -> None:
        """An item that is no part of a plan: where to go now."""
        item = _item_of(message)
        fault = (
            Fault(mavlink.MAV_MISSION_INVALID_PARAM5_X, "Reposition denied: position is not a number")
            if item is None
            else self._go_to(item, message.current == _CHANGE_HEIGHT)
        )
        if fault is not None:
            say(fault.text)
        self._ack(client, mavlink.MAV_MISSION_ACCEPTED if fault is None else fault.result, self._kind, reply)

    def _late_item(self, seq: int, client: Client, reply: Reply) -> None:
        """The last item again: our acknowledgement was lost."""
        finished = self._finished.get(client)
        if finished is not None and seq == finished[0] - 1:
            self._ack_upload(client, finished[1], reply)

    def _finish(self, client: Client, items: tuple[Item, ...], reply: Reply, say: Say) -> None:
        fault = self._accept(items)
        if fault is None:
            self.items = items
        else:
            say(f"{self._name} denied: {fault.text}")
        result = mavlink.MAV_MISSION_ACCEPTED if fault is None else fault.result
        while len(self._finished) >= MOST_TRANSFERS:
            del self._finished[next(iter(self._finished))]
        self._finished[client] = (len(items), result)
        self._ack_upload(client, result, reply)

    def _acknowledged(self, message: Any, client: Client, now: float, reply: Reply, say: Say) -> None:
        """MISSION_ACK ends a download; with anything but ACCEPTED it also takes an upload back."""
        self._downloads.pop(client, None)
        if message.type != mavlink.MAV_MISSION_ACCEPTED:
            self._uploads.pop(client, None)

    def _clear(self, message: Any, client: Client, now: float, reply: Reply, say: Say) -> None:
        fault = self.clear(client)
        if fault is not None:
            say(f"{self._name} not cleared: {fault.text}")
        self._ack(client, mavlink.MAV_MISSION_ACCEPTED if fault is None else fault.result, self._kind, reply)

    def clear(self, client: Client) -> Fault | None:
        """Have no items any more, or say why not."""
        self._uploads.pop(client, None)
        fault = self._accept(())
        if fault is None:
            self.items = ()
        return fault

    def _partial(self, message: Any, client: Client, now: float, reply: Reply, say: Say) -> None:
        say("Partial mission writes are not supported; upload the whole mission")
        self._ack(client, mavlink.MAV_MISSION_UNSUPPORTED, message.mission_type, reply)

    def _ask(self, client: Client, reply: Reply) -> None:
        seq = len(self._uploads[client].items)
        reply(mavlink.MAVLink_mission_request_int_message(client.system, client.component, seq, self._kind))

    def _ack(self, client: Client, result: int, kind: int, reply: Reply) -> None:
        reply(MissionAck(client.system, client.component, result, kind))

    def _ack_upload(self, client: Client, result: int, reply: Reply) -> None:
        """The end of an upload, with the id of the plan that it put on board."""
        new = plan_id(self.items) if result == mavlink.MAV_MISSION_ACCEPTED else 0
        reply(MissionAck(client.system, client.component, result, self._kind, new))

    # Time

    def to_send(self, now: float) -> list[tuple[Client, Any, str]]:
        """Requests to repeat, and the end of uploads that stalled: (client, message, text or empty)."""
        out: list[tuple[Client, Any, str]] = []
        for client, upload in list(self._uploads.items()):
            if now - upload.last_item >= PATIENCE:
                del self._uploads[client]
                got = f"{len(upload.items)} of {upload.count}"
                text = f"{self._name} upload stopped at item {got}; nothing has changed"
                cancelled = mavlink.MAV_MISSION_OPERATION_CANCELLED
                message = MissionAck(client.system, client.component, cancelled, self._kind)
                out.append((client, message, text))
            elif now - upload.last_request >= RETRY_INTERVAL:
                upload.last_request = now
                self._ask(client, lambda message, client=client: out.append((client, message, "")))  # type: ignore[misc]
        return out

    def next_deadline(self) -> float:
        """When a request has to be repeated; inf if none."""
        return min(
            (min(u.last_request + RETRY_INTERVAL, u.last_item + PATIENCE) for u in self._uploads.values()),
            default=math.inf,
        )

    def forget(self, peer: Address) -> None:
        """A peer has gone: drop its transfers."""
        for table in (self._uploads, self._downloads, self._finished):
            for client in [client for client in table if client.peer == peer]:
                table.pop(client)


_Handler = Callable[[Missions, Any, Client, float, Reply, Say], None]
_HANDLERS: dict[int, _Handler] = {
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST: Missions._request_list,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST: Missions._request,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT: Missions._request,
    mavlink.MAVLINK_MSG_ID_MISSION_COUNT: Missions._count,
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM: Missions._item,
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT: Missions._item,
    mavlink.MAVLINK_MSG_ID_MISSION_ACK: Missions._acknowledged,
    mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL: Missions._clear,
    mavlink.MAVLINK_MSG_ID_MISSION_WRITE_PARTIAL_LIST: Missions._partial,
}
MESSAGES = frozenset(_HANDLERS)


def _item_of(message: Any) -> Item | None:
    """The item of MISSION_ITEM_INT or MISSION_ITEM (degrees); None if its position is no number."""
    x, y = message.x, message.y
    if message.id == mavlink.MAVLINK_MSG_ID_MISSION_ITEM:
        scale = DEG_E7_PER_DEG if message.command in WITH_PLACE else 1.0
        if not (abs(x) < 214 and abs(y) < 214):
            return None
        x, y = round(x * scale), round(y * scale)
    p = (message.param1, message.param2, message.param3, message.param4)
    return Item(message.frame, message.command, message.autocontinue, *p, x, y, message.z)


def _item_int_message(item: Item, seq: int, client: Client, kind: int) -> Any:
    to = (client.system, client.component)
    rest = (item.p1, item.p2, item.p3, item.p4, item.x, item.y, item.z, kind)
    return mavlink.MAVLink_mission_item_int_message(
        *to, seq, item.frame, item.command, 0, item.autocontinue, *rest
    )


def _item_message(item: Item, seq: int, client: Client, kind: int) -> Any:
    to = (client.system, client.component)
    scale = DEG_E7_PER_DEG if item.command in WITH_PLACE else 1.0
    rest = (item.p1, item.p2, item.p3, item.p4, item.x / scale, item.y / scale, item.z, kind)
    return mavlink.MAVLink_mission_item_message(
        *to, seq, item.frame, item.command, 0, item.autocontinue, *rest
    )
