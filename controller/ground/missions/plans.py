"""The three plans on board (mission, geofence, rally points), each with its own transfers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.link.peers import Address
from controller.ground.missions.mission_plan import Fault, Item
from controller.ground.missions.plan_id import MissionAck
from controller.ground.missions.transfer import FENCE, MISSION, RALLY, Client, Missions, Reply, Say

_ALL: int = mavlink.MAV_MISSION_TYPE_ALL
Accept = Callable[[tuple[Item, ...]], Fault | None]


class Plans:
    """Messages of the mission protocol go to the plan of their type."""

    def __init__(
        self, mission: Accept, fence: Accept, rally: Accept, go_to: Callable[[Item, bool], Fault | None]
    ) -> None:
        self.mission = Missions(mission, go_to)
        self.fence = Missions(fence, go_to, FENCE)
        self.rally = Missions(rally, go_to, RALLY)
        self._by_kind = {MISSION: self.mission, FENCE: self.fence, RALLY: self.rally}

    @property
    def items(self) -> tuple[Item, ...]:
        """Of the mission."""
        return self.mission.items

    def receive(self, message: Any, client: Client, now: float, reply: Reply, say: Say) -> None:
        """Any MISSION_* message of the transfer protocol."""
        kind = message.mission_type
        if kind == _ALL and message.id == mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL:
            faults = [plan.clear(client) for plan in self._by_kind.values()]
            result = next((f.result for f in faults if f is not None), mavlink.MAV_MISSION_ACCEPTED)
            reply(MissionAck(client.system, client.component, result, kind))
        elif (plan := self._by_kind.get(kind)) is not None:
            plan.receive(message, client, now, reply, say)
        elif message.id != mavlink.MAVLINK_MSG_ID_MISSION_ACK:
            say(f"Plans of type {kind} are not supported; use 0, 1 or 2")
            result = mavlink.MAV_MISSION_UNSUPPORTED
            reply(MissionAck(client.system, client.component, result, kind))

    def to_send(self, now: float) -> list[tuple[Client, Any, str]]:
        """As `Missions.to_send`, of every plan."""
        return [due for plan in self._by_kind.values() for due in plan.to_send(now)]

    def next_deadline(self) -> float:
        """When `to_send` has something to say next; inf: not before something comes."""
        return min(plan.next_deadline() for plan in self._by_kind.values())

    def forget(self, peer: Address) -> None:
        """A peer has gone: drop its transfers."""
        for plan in self._by_kind.values():
            plan.forget(peer)
