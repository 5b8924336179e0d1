"""The mission protocol message by message, without a station around it."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.link.peers import Address
from controller.ground.missions.mission_plan import MOST_ITEMS, Fault, Item
from controller.ground.missions.transfer import (
    FENCE,
    MISSION,
    MOST_TRANSFERS,
    PATIENCE,
    RALLY,
    RETRY_INTERVAL,
    Client,
    Missions,
)

ONE = Client(Address(0, "127.0.0.1", 14550), 255, 190)
TWO = Client(Address(1, "127.0.0.1", 14540), 254, 191)
ACCEPTED, DENIED = mavlink.MAV_MISSION_ACCEPTED, mavlink.MAV_MISSION_DENIED
Reply = tuple[Any, ...]


def count_of(count: int, system: int = 255, component: int = 190, kind: int = MISSION) -> Reply:
    return ("MISSION_COUNT", system, component, count, kind)


def request(seq: int, kind: int = MISSION, client: Client = ONE) -> Reply:
    return ("MISSION_REQUEST_INT", client.system, client.component, seq, kind)


def ack(result: int, kind: int = MISSION, client: Client = ONE) -> Reply:
    return ("MISSION_ACK", client.system, client.component, result, kind)


def short(message: Any) -> Reply:
    """Type, target and what matters of a reply."""
    kind = message.get_type()
    what = {"MISSION_COUNT": "count", "MISSION_REQUEST_INT": "seq", "MISSION_ACK": "type"}[kind]
    value = getattr(message, what)
    return (kind, message.target_system, message.target_component, value, message.mission_type)


class Rig:
    """The protocol object; `fault` is what the vehicle has against plans and places."""

    def __init__(self, kind: int = MISSION) -> None:
        self.kind = kind
        self.fault: Fault | None = None
        self.went_to: list[tuple[Item, bool]] = []
        self.now = 10.0
        self.said: list[str] = []
        self.raw: list[Any] = []
        self.missions = Missions(lambda items: self.fault, self.go_to, kind)

    def go_to(self, item: Item, only_height: bool) -> Fault | None:
        self.went_to.append((item, only_height))
        return self.fault

    def send(self, message: Any, client: Client = ONE) -> list[Reply]:
        """Send a message; what is replied to it."""
        self.raw = []
        self.missions.receive(message, client, self.now, self.raw.append, self.said.append)
        return [short(reply) for reply in self.raw if not reply.get_type().startswith("MISSION_ITEM")]

    def count(self, count: int, client: Client = ONE) -> list[Reply]:
        return self.send(mavlink.MAVLink_mission_count_message(1, 1, count, self.kind), client)

    def item(
        self, seq: int, client: Client = ONE, current: int = 0, x: int = 5, z: float = 9.0
    ) -> list[Reply]:
        fields = (1, 1, seq, 6, 16, current, 1, 0.5, 1.5, 2.5, 3.5, x, 7, z, self.kind)
        return self.send(mavlink.MAVLink_mission_item_int_message(*fields), client)

    def old_item(self, seq: int, x: float, y: float, command: int = 16, current: int = 0) -> list[Reply]:
        fields = (1, 1, seq, 3, command, current, 1, 0.0, 0.0, 0.0, 0.0, x, y, 9.0, self.kind)
        return self.send(mavlink.MAVLink_mission_item_message(*fields))

    def ask_for(self, seq: int, client: Client = ONE, old: bool = False) -> list[Reply]:
        make = mavlink.MAVLink_mission_request_message if old else mavlink.MAVLink_mission_request_int_message
        return self.send(make(1, 1, seq, self.kind), client)

    def list(self, client: Client = ONE) -> list[Reply]:
        return self.send(mavlink.MAVLink_mission_request_list_message(1, 1, self.kind), client)

    def acknowledge(self, result: int, client: Client = ONE) -> list[Reply]:
        return self.send(mavlink.MAVLink_mission_ack_message(1, 1, result, self.kind), client)

    def upload(self, count: int, client: Client = ONE, x: int = 5) -> list[Reply]:
        """The whole of an upload; the last reply."""
        replies = self.count(count, client)
        for seq in range(count):
            replies = self.item(seq, client, x=x)
        return replies

    def due(self) -> list[tuple[Client, Reply, str]]:
        return [(client, short(reply), text) for client, reply, text in self.missions.to_send(self.now)]


@pytest.mark.parametrize("kind", [MISSION, FENCE, RALLY])
def test_each_item_is_asked_for_in_turn_and_the_last_one_acknowledged(kind: int) -> None:
    rig = Rig(kind)
    assert rig.count(2) == [request(0, kind)]
    assert rig.item(0) == [request(1, kind)]
    assert rig.missions.items == ()
    assert rig.item(1) == [ack(ACCEPTED, kind)]
    assert rig.missions.items == (Item(6, 16, 1, 0.5, 1.5, 2.5, 3.5, 5, 7, 9.0),) * 2
    assert rig.said == []


def test_replies_go_to_the_client_that_asked() -> None:
    rig = Rig()
    assert rig.count(2, TWO) == [request(0, client=TWO)]
    assert rig.count(1, ONE) == [request(0)]
    assert rig.item(0, TWO) == [request(1, client=TWO)]
    assert rig.item(0, ONE) == [ack(ACCEPTED)]
    assert rig.item(1, TWO) == [ack(ACCEPTED, client=TWO)]
    assert len(rig.missions.items) == 2


def test_an_item_that_is_not_the_next_is_ignored() -> None:
    rig = Rig()
    rig.count(3)
    assert rig.item(1) == []
    assert rig.item(0) == [request(1)]
    assert rig.item(0) == []
    assert rig.item(2) == []
    assert rig.item(1) == [request(2)]


def test_an_item_without_an_upload_is_ignored() -> None:
    rig = Rig()
    assert rig.item(0) == []
    assert rig.raw == []


def test_a_plan_that_is_refused_leaves_the_old_one_and_says_why() -> None:
    rig = Rig()
    rig.upload(1)
    rig.fault = Fault(DENIED, "too far")
    assert rig.upload(3) == [ack(DENIED)]
    assert rig.said == ["Mission denied: too far"]
    assert len(rig.missions.items) == 1


def test_the_last_item_again_is_acknowledged_again_with_the_same_result() -> None:
    rig = Rig()
    rig.fault = Fault(DENIED, "too far")
    rig.upload(3)
    assert rig.item(2) == [ack(DENIED)]
    assert rig.item(1) == []
    assert rig.item(0) == []
    assert rig.item(2, TWO) == []  # another client has finished nothing


def test_a_new_upload_makes_the_last_items_of_the_one_before_strangers() -> None:
    rig = Rig()
    rig.upload(2)
    rig.count(2)
    assert rig.item(1) == []
    rig.acknowledge(mavlink.MAV_MISSION_OPERATION_CANCELLED)
    assert rig.item(1) == []


def test_a_count_of_zero_clears_and_ends_an_upload_that_is_under_way() -> None:
    rig = Rig()
    rig.upload(2)
    rig.count(3)
    assert rig.count(0) == [ack(ACCEPTED)]
    assert rig.missions.items == ()
    assert rig.item(0) == []
    rig.now += PATIENCE
    assert rig.due() == []


def test_the_longest_plan_and_one_longer() -> None:
    rig = Rig()
    assert rig.count(MOST_ITEMS) == [request(0)]
    assert rig.count(MOST_ITEMS + 1) == [ack(mavlink.MAV_MISSION_NO_SPACE)]
    assert rig.said == [f"Mission of {MOST_ITEMS + 1} items is too long; at most {MOST_ITEMS}"]


def client_number(number: int) -> Client:
    return Client(Address(0, "10.0.0.1", number), 1 + number, 190)


def test_so_many_uploads_at_once_and_no_more() -> None:
    rig = Rig()
    clients = [client_number(number) for number in range(MOST_TRANSFERS)]
    for client in clients:
        assert rig.count(1, client) == [request(0, client=client)]
    assert rig.count(1, ONE) == [ack(mavlink.MAV_MISSION_ERROR)]
    assert rig.said == ["Too many mission uploads at once; try again later"]
    assert rig.item(0, ONE) == []
    assert rig.count(2, clients[3]) == [request(0, client=clients[3])]  # its own may begin again
    rig.item(0, clients[0])
    assert rig.count(1, ONE) == [request(0)]


def test_only_the_oldest_of_too_many_ends_of_uploads_is_forgotten() -> None:
    rig = Rig()
    clients = [client_number(number) for number in range(MOST_TRANSFERS + 1)]
    for client in clients:
        rig.upload(1, client)
    answered = [client for client in clients if rig.item(0, client)]
    assert answered == clients[1:]


def test_a_download_keeps_the_plan_that_it_began_with() -> None:
    rig = Rig()
    rig.upload(2, x=5)
    assert rig.list() == [count_of(2)]
    rig.upload(1, TWO, x=8)
    rig.ask_for(1)
    assert (rig.raw[0].seq, rig.raw[0].x) == (1, 5)
    rig.ask_for(0, TWO)
    assert (rig.raw[0].seq, rig.raw[0].x) == (0, 8)  # never asked for a list: the plan on board
    rig.acknowledge(ACCEPTED)
    rig.ask_for(0)
    assert rig.raw[0].x == 8
    assert rig.list() == [count_of(1)]


def test_an_item_past_the_end_does_not_exist() -> None:
    rig = Rig()
    rig.upload(2)
    assert rig.ask_for(2) == [ack(mavlink.MAV_MISSION_INVALID_SEQUENCE)]
    assert rig.said == ["Mission item 2 does not exist; there are 2"]


def test_only_the_oldest_of_too_many_downloads_loses_its_plan() -> None:
    rig = Rig()
    rig.upload(1, x=5)
    clients = [client_number(number) for number in range(MOST_TRANSFERS)]
    for client in clients:
        rig.list(client)
    rig.list(clients[0])
    rig.upload(1, TWO, x=8)

    def without() -> list[Client]:
        """Who is given the new plan."""
        seen = {}
        for client in clients:
            rig.ask_for(0, client)
            seen[client] = rig.raw[0].x
        return [client for client in seen if seen[client] == 8]

    rig.list(clients[5])  # asks again: nobody else has to go
    assert without() == [clients[5]]
    rig.list(ONE)
    assert without() == [clients[1], clients[5]]


def test_items_are_sent_whole_in_both_messages() -> None:
    rig = Rig()
    rig.upload(1, x=473_977_420)
    rig.ask_for(0)
    (m,) = rig.raw
    assert m.get_type() == "MISSION_ITEM_INT"
    assert (m.target_system, m.target_component, m.seq, m.mission_type) == (255, 190, 0, MISSION)
    assert (m.frame, m.command, m.current, m.autocontinue) == (6, 16, 0, 1)
    assert (m.param1, m.param2, m.param3, m.param4) == (0.5, 1.5, 2.5, 3.5)
    assert (m.x, m.y, m.z) == (473_977_420, 7, 9.0)
    rig.ask_for(0, old=True)
    (m,) = rig.raw
    assert m.get_type() == "MISSION_ITEM"
    assert (m.target_system, m.target_component, m.seq, m.mission_type) == (255, 190, 0, MISSION)
    assert (m.frame, m.command, m.current, m.autocontinue) == (6, 16, 0, 1)
    assert (m.param1, m.param2, m.param3, m.param4) == (0.5, 1.5, 2.5, 3.5)
    assert (m.x, m.y, m.z) == (47.397742, 7e-7, 9.0)


def test_old_items_have_degrees_where_they_name_a_place_and_plain_numbers_elsewhere() -> None:
    rig = Rig()
    rig.count(2)
    rig.old_item(0, 47.25, -8.5)
    rig.old_item(1, 3.0, -4.0, command=177)
    assert [(item.x, item.y) for item in rig.missions.items] == [(472_500_000, -85_000_000), (3, -4)]
    rig.ask_for(1, old=True)
    assert (rig.raw[0].x, rig.raw[0].y) == (3.0, -4.0)


@pytest.mark.parametrize(("x", "y"), [(math.nan, 0.0), (0.0, math.nan), (214.0, 0.0), (0.0, -214.0)])
def test_an_old_item_whose_degrees_fit_no_integer_ends_the_upload(x: float, y: float) -> None:
    rig = Rig()
    rig.count(1)
    assert rig.old_item(0, x, y) == [ack(mavlink.MAV_MISSION_INVALID_PARAM5_X)]
    assert rig.said == ["Mission item 0: position is not a number"]
    assert rig.item(0) == []
    rig.count(1)
    assert rig.old_item(0, 213.9, -213.9) == [ack(ACCEPTED)]  # `check` judges it


@pytest.mark.parametrize(("current", "only_height"), [(2, False), (3, True)])
def test_an_item_of_guided_flight_is_flown_to_at_once_and_is_no_part_of_an_upload(
    current: int, only_height: bool
) -> None:
    rig = Rig()
    rig.count(1)
    assert rig.item(0, current=current) == [ack(ACCEPTED)]
    ((item, flag),) = rig.went_to
    assert (item.x, item.z, flag) == (5, 9.0, only_height)
    assert rig.missions.items == ()
    assert rig.said == []
    rig.fault = Fault(DENIED, "not in flight")
    assert rig.item(0, current=current) == [ack(DENIED)]
    assert rig.said == ["not in flight"]
    rig.fault = None
    assert rig.item(0, current=1) == [ack(ACCEPTED)]
    assert len(rig.missions.items) == 1


def test_a_guided_item_without_a_place_is_refused() -> None:
    rig = Rig()
    assert rig.old_item(0, math.nan, 0.0, current=2) == [ack(mavlink.MAV_MISSION_INVALID_PARAM5_X)]
    assert rig.said == ["Reposition denied: position is not a number"]
    assert rig.went_to == []


def test_an_acknowledgement_with_an_error_cancels_the_upload_and_only_then() -> None:
    rig = Rig()
    rig.count(2)
    rig.count(1, TWO)
    rig.acknowledge(ACCEPTED)
    assert rig.item(0) == [request(1)]
    assert rig.acknowledge(mavlink.MAV_MISSION_OPERATION_CANCELLED) == []
    assert rig.item(1) == []
    assert rig.missions.items == ()
    assert rig.item(0, TWO) == [ack(ACCEPTED, client=TWO)]  # another client's goes on


def test_clear_takes_the_plan_and_the_clients_own_upload() -> None:
    rig = Rig()
    rig.upload(2)
    rig.count(2)
    clear = mavlink.MAVLink_mission_clear_all_message(1, 1, MISSION)
    assert rig.send(clear) == [ack(ACCEPTED)]
    assert rig.missions.items == ()
    assert rig.item(0) == []
    assert rig.said == []


def test_a_plan_that_cannot_be_cleared_stays() -> None:
    rig = Rig()
    rig.upload(2)
    rig.fault = Fault(DENIED, "in flight")
    assert rig.send(mavlink.MAVLink_mission_clear_all_message(1, 1, MISSION)) == [ack(DENIED)]
    assert rig.said == ["Mission not cleared: in flight"]
    assert len(rig.missions.items) == 2


def test_parts_of_a_plan_cannot_be_written() -> None:
    rig = Rig()
    part = mavlink.MAVLink_mission_write_partial_list_message(1, 1, 0, 1, MISSION)
    assert rig.send(part) == [ack(mavlink.MAV_MISSION_UNSUPPORTED)]
    assert rig.said == ["Partial mission writes are not supported; upload the whole mission"]


def test_other_messages_are_none_of_its_business() -> None:
    rig = Rig()
    assert rig.send(mavlink.MAVLink_mission_current_message(3)) == []


def test_an_item_that_does_not_come_is_asked_for_again_at_intervals() -> None:
    rig = Rig()
    assert rig.missions.next_deadline() == math.inf
    rig.count(2)
    assert rig.missions.next_deadline() == rig.now + RETRY_INTERVAL
    rig.now += RETRY_INTERVAL - 0.01
    assert rig.due() == []
    rig.now += 0.01
    assert rig.due() == [(ONE, request(0), "")]
    assert rig.due() == []
    assert rig.missions.next_deadline() == rig.now + RETRY_INTERVAL
    rig.now += 0.1
    rig.item(0)
    assert rig.missions.next_deadline() == rig.now + RETRY_INTERVAL
    rig.now += RETRY_INTERVAL
    assert rig.due() == [(ONE, request(1), "")]


def test_an_upload_without_an_item_for_too_long_is_dropped() -> None:
    rig = Rig()
    rig.count(3)
    rig.now += 1.0
    rig.item(0)
    rig.count(1, TWO)
    rig.now += PATIENCE - 0.25
    assert [client for client, _, _ in rig.due()] == [ONE, TWO]
    assert rig.missions.next_deadline() == rig.now + 0.25
    rig.now += 0.2
    assert rig.missions.next_deadline() == pytest.approx(rig.now + 0.05)  # sooner than the next request
    rig.now += 0.05
    cancelled = mavlink.MAV_MISSION_OPERATION_CANCELLED
    first, second = rig.due()
    assert first == (ONE, ack(cancelled), "Mission upload stopped at item 1 of 3; nothing has changed")
    assert second[:2] == (TWO, ack(cancelled, client=TWO))
    assert rig.item(1) == []
    assert rig.missions.next_deadline() == math.inf


def test_a_peer_that_has_gone_loses_its_transfers_and_nobody_else_does() -> None:
    rig = Rig()
    rig.upload(1, x=5)
    rig.upload(1, TWO, x=5)
    for client in (ONE, TWO):
        rig.list(client)
    rig.missions.forget(ONE.peer)
    assert rig.item(0, ONE) == []
    assert rig.item(0, TWO) == [ack(ACCEPTED, client=TWO)]
    rig.upload(1, client_number(0), x=8)
    rig.ask_for(0, ONE)
    assert rig.raw[0].x == 8
    rig.ask_for(0, TWO)
    assert rig.raw[0].x == 5
    for client in (ONE, TWO):
        rig.count(1, client)
    rig.missions.forget(ONE.peer)
    assert rig.item(0, ONE) == []
    assert rig.item(0, TWO) == [ack(ACCEPTED, client=TWO)]
