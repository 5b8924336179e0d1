"""Plan ids in MISSION_CURRENT, MISSION_COUNT and MISSION_ACK, as the MAVLink specification has them."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.missions.mission_plan import Item
from controller.ground.missions.plan_id import plan_id
from sitl_bridge.mavlink.framing import split
from tests.controller.ground.kinematic import ZURICH
from tests.controller.ground.missions.test_missions import SQUARE, Uploader, other
from tests.controller.ground.rig import Client, Rig

MISSION, FENCE, RALLY = 0, 1, 2
CIRCLE = (6, 5003, 1, 40.0, 0.0, 0.0, 0.0, round(ZURICH[0] * 1e7), round(ZURICH[1] * 1e7), 0.0)
POINT = (6, 5100, 1, 0.0, 0.0, 0.0, 0.0, round(ZURICH[0] * 1e7), round(ZURICH[1] * 1e7), 5.0)


def payloads(client: Client, number: int, length: int) -> list[bytes]:
    """Of the messages of a number that have come, zeros that were cut off put back."""
    frames = [frame for raw in client.raw for frame in split(raw).frames]
    return [frame.payload.ljust(length, b"\0") for frame in frames if frame.message_id == number]


def current_ids(rig: Rig, client: Client) -> tuple[int, ...]:
    client.clear()
    client.command(512, 42)
    return struct.unpack("<HHBBIII", payloads(client, 42, 18)[-1])[4:]


def acknowledged_id(client: Client) -> int:
    return int(struct.unpack("<BBBBI", payloads(client, 47, 8)[-1])[4])


def counted_id(rig: Rig, client: Client, kind: int) -> int:
    client.clear()
    client.send(mavlink.MAVLink_mission_request_list_message(1, 1, kind))
    rig.run(0.1)
    return int(struct.unpack("<HBBBI", payloads(client, 44, 9)[-1])[4])


def ready() -> tuple[Rig, Client]:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    return rig, client


@pytest.mark.parametrize(("kind", "items"), [(MISSION, SQUARE), (FENCE, [CIRCLE]), (RALLY, [POINT])])
def test_the_same_id_comes_back_on_upload_on_download_and_all_the_time(kind: int, items: Any) -> None:
    rig, client = ready()
    assert current_ids(rig, client) == (0, 0, 0)  # "0 if (...) there is no mission loaded"
    client.clear()
    assert Uploader(client, items, kind).run() == 0
    new = acknowledged_id(client)
    assert new != 0
    ids = [0, 0, 0]
    ids[kind] = new
    assert current_ids(rig, client) == tuple(ids)
    assert counted_id(rig, client, kind) == new
    assert Uploader(client, items, kind).run() == 0  # the same plan again
    assert current_ids(rig, client) == tuple(ids)


def test_the_id_changes_with_any_change_of_the_plan_and_goes_with_it() -> None:
    rig, client = ready()
    assert Uploader(client, SQUARE).run() == 0
    before = current_ids(rig, client)[0]
    assert Uploader(client, [*SQUARE, other(112, 1.0)]).run() == 0
    assert current_ids(rig, client)[0] not in (0, before)
    client.clear()
    client.send(mavlink.MAVLink_mission_clear_all_message(1, 1, MISSION))
    rig.run(0.1)
    assert acknowledged_id(client) == 0
    assert current_ids(rig, client) == (0, 0, 0)


def test_a_plan_that_is_denied_has_no_id_and_changes_none() -> None:
    rig, client = ready()
    assert Uploader(client, SQUARE).run() == 0
    before = current_ids(rig, client)
    client.clear()
    assert Uploader(client, [other(9999)]).run() != 0
    assert acknowledged_id(client) == 0
    assert current_ids(rig, client) == before


def test_each_field_of_an_item_counts() -> None:
    item = Item(6, 16, 1, 0.0, 0.0, 0.0, float("nan"), 1, 2, 3.0)
    changed = [item._replace(**{name: 5}) for name in item._fields]
    assert len({plan_id((one,)) for one in (item, *changed)}) == len(item._fields) + 1
    assert plan_id((item, changed[0])) != plan_id((changed[0], item))
