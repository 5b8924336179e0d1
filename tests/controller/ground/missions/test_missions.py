"""The mission protocol, and flying a plan."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.motion.trajectory import stopping_distance
from tests.controller.ground.in_flight import flying
from tests.controller.ground.kinematic import ZURICH
from tests.controller.ground.rig import Channel, Client, Rig

NAN = math.nan
ACCEPTED = mavlink.MAV_MISSION_ACCEPTED
Items = list[tuple[Any, ...]]


def waypoint(
    north: float, east: float, up: float = 5.0, hold: float = 0.0, radius: float = 0.0
) -> tuple[Any, ...]:
    """(frame, command, autocontinue, p1 to p4, x, y, z) of a way-point so many metres from home."""
    lat = round((ZURICH[0] + north / 111_200) * 1e7)
    lon = round((ZURICH[1] + east / 75_500) * 1e7)
    return (6, 16, 1, hold, radius, 0.0, NAN, lat, lon, up)


def other(command: int, p1: float = 0.0, p2: float = 0.0, autocontinue: int = 1) -> tuple[Any, ...]:
    return (2, command, autocontinue, p1, p2, 0.0, 0.0, 0, 0, 0.0)


SQUARE: Items = [waypoint(8, 0), other(178, 1.0, 2.0), waypoint(8, 8, hold=1.0), waypoint(0, 8, 6)]


class Uploader:
    """A client that uploads as the protocol says, and asks nobody twice."""

    def __init__(self, client: Client, items: Items, kind: int = 0) -> None:
        self.client, self.items, self.kind = client, items, kind
        self._seen = len(client.inbox)
        self.result: int | None = None

    def start(self) -> None:
        self.client.send(mavlink.MAVLink_mission_count_message(1, 1, len(self.items), self.kind))

    def poll(self) -> None:
        fresh, self._seen = self.client.inbox[self._seen :], len(self.client.inbox)
        for message in fresh:
            if message.get_type() in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
                self.item(message.seq)
            elif message.get_type() == "MISSION_ACK":
                self.result = message.type

    def item(self, seq: int) -> None:
        frame, command, auto, *rest = self.items[seq]
        fields = (1, 1, seq, frame, command, 0, auto, *rest, self.kind)
        self.client.send(mavlink.MAVLink_mission_item_int_message(*fields))

    def run(self, timeout: float = 20.0) -> int:
        self.start()
        end = self.client.rig.now + timeout
        while self.result is None and self.client.rig.now < end:
            self.client.rig.run(0.02)
            self.poll()
        assert self.result is not None, "no MISSION_ACK"
        return self.result


def download(client: Client, timeout: float = 10.0, plan: int = 0) -> Items:
    """Every item, asked for until it comes; never acknowledged (as MAVProxy does it)."""
    end = client.rig.now + timeout

    def ask(message: Any, kind: str, fits: Any) -> Any:
        while client.rig.now < end:
            client.clear()
            client.send(message)
            client.rig.run(0.1)
            found = [m for m in client.got(kind) if fits(m)]
            if found:
                return found[0]
        raise AssertionError(f"no {kind}")

    count = ask(
        mavlink.MAVLink_mission_request_list_message(1, 1, plan), "MISSION_COUNT", lambda m: True
    ).count
    items = []
    for seq in range(count):
        request = mavlink.MAVLink_mission_request_int_message(1, 1, seq, plan)
        m = ask(request, "MISSION_ITEM_INT", lambda m, seq=seq: m.seq == seq)
        numbers = (m.param1, m.param2, m.param3, m.param4)
        items.append((m.frame, m.command, m.autocontinue, *numbers, m.x, m.y, m.z))
    return items


def same(a: Items, b: Items) -> bool:
    return [[repr(float(x)) for x in item] for item in a] == [[repr(float(x)) for x in item] for item in b]


def test_a_plan_comes_back_as_it_went_up() -> None:
    rig = Rig()
    client, reader = rig.client(), rig.client(14540, link=1)
    assert Uploader(client, SQUARE).run() == ACCEPTED
    assert same(download(reader), SQUARE)
    assert same(download(client), SQUARE)  # and nobody waits for the acknowledgement of the first


@pytest.mark.parametrize("seed", range(8))
def test_upload_and_download_over_a_lossy_link(seed: int) -> None:
    rig = Rig()
    client = rig.client(channel=Channel(0.2, 0.2, 0.2, seed))
    uploader = Uploader(client, SQUARE * 5)
    end = rig.now + 30
    while uploader.result is None and rig.now < end:
        if not client.got("MISSION_REQUEST_INT"):
            uploader.start()
        for _ in range(10):
            rig.run(0.02)
            uploader.poll()
        if uploader.result is None and len(rig.station.missions.items) == 20:
            uploader.item(19)  # its acknowledgement was lost
    assert uploader.result == ACCEPTED
    assert same(download(client, 60.0), SQUARE * 5)


def test_a_half_finished_upload_changes_nothing() -> None:
    rig = Rig()
    client = rig.client()
    assert Uploader(client, SQUARE).run() == ACCEPTED
    stalled = Uploader(client, [waypoint(1, 1)] * 3)
    stalled.start()
    rig.run(0.1)
    stalled.item(0)
    rig.run(10.0)
    assert client.got("MISSION_ACK")[-1].type == mavlink.MAV_MISSION_OPERATION_CANCELLED
    assert len(client.got("MISSION_REQUEST_INT")) > 10  # it asked again
    assert "nothing has changed" in " ".join(client.texts())
    assert same(download(client), SQUARE)


@pytest.mark.parametrize(
    ("item", "result", "words"),
    [
        (other(3000), mavlink.MAV_MISSION_UNSUPPORTED, "3000"),
        ((7, *waypoint(0, 0)[1:]), mavlink.MAV_MISSION_UNSUPPORTED_FRAME, "frame 7"),
        (waypoint(0, 0, NAN), mavlink.MAV_MISSION_INVALID_PARAM7, "altitude"),
        (waypoint(0, 0, 500.0), mavlink.MAV_MISSION_DENIED, "GF_MAX_VER_DIST"),
        (waypoint(2000, 0), mavlink.MAV_MISSION_DENIED, "GF_MAX_HOR_DIST"),
        ((6, *other(22)[1:9], 500.0), mavlink.MAV_MISSION_DENIED, "GF_MAX_VER_DIST"),
        ((*waypoint(0, 0)[:7], 2_000_000_000, 0, 5.0), mavlink.MAV_MISSION_INVALID_PARAM5_X, "latitude"),
        ((*waypoint(0, 0)[:7], 0, 2_000_000_000, 5.0), mavlink.MAV_MISSION_INVALID_PARAM6_Y, "longitude"),
        (other(177, 9, 1), mavlink.MAV_MISSION_INVALID_PARAM1, "jump to item 9"),
        (other(177, 2, 1), mavlink.MAV_MISSION_INVALID_PARAM1, "jump to item 2"),  # one past the end
        (other(177, 1, -1), mavlink.MAV_MISSION_INVALID_PARAM1, "endless loop"),
        (other(178, 1, -3), mavlink.MAV_MISSION_INVALID_PARAM2, "speed"),
        (other(178, 1, 1e9), mavlink.MAV_MISSION_INVALID_PARAM2, "speed"),
        (other(178, 7, 3), mavlink.MAV_MISSION_INVALID_PARAM1, "kind 7"),
        (waypoint(0, 0, hold=-1e38), mavlink.MAV_MISSION_INVALID_PARAM1, "wait"),
        (waypoint(0, 0, radius=-5), mavlink.MAV_MISSION_INVALID_PARAM2, "radius"),
        (other(201, 9), mavlink.MAV_MISSION_INVALID_PARAM1, "kind 9"),
        (other(201, 2, 2), mavlink.MAV_MISSION_INVALID_PARAM2, "item 2 of 2"),
        (waypoint(0, 0, hold=math.inf), mavlink.MAV_MISSION_INVALID_PARAM1, "infinite"),
    ],
)
def test_what_cannot_be_flown_is_refused_whole(item: tuple[Any, ...], result: int, words: str) -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    rig.station.parameters.set("GF_MAX_HOR_DIST", 500.0)
    rig.station.parameters.set("GF_MAX_VER_DIST", 120.0)
    assert Uploader(client, SQUARE).run() == ACCEPTED
    assert Uploader(client, [waypoint(1, 1), item]).run() == result
    text = client.texts()[-1]
    assert "item 1" in text
    assert words in text
    assert same(download(client), SQUARE)


def test_items_too_low_for_the_load_are_flown_as_low_as_it_allows_and_said() -> None:
    rig, client = flying()
    plan = [waypoint(3, 0, 5.0), waypoint(6, 0, 1.0)]
    assert Uploader(client, plan).run() == ACCEPTED
    rig.run(0.1)
    assert any("too low for the load are flown at 2.1 m above home" in text for text in client.texts())
    assert same(download(client), plan)  # as it went up
    assert client.command(176, 1, 4, 4).result == 0
    rig.run_until(lambda: rig.station.machine.mode.name == "HOLD")
    fence = rig.station.machine.fence
    assert fence is not None
    assert rig.view.position[2] == pytest.approx(fence.home[2] + fence.least_height, abs=0.05)


def test_two_clients_at_once_do_not_mix() -> None:
    rig = Rig()
    one, two = rig.client(), rig.client(14540, link=1)
    first, second = Uploader(one, SQUARE), Uploader(two, [waypoint(3, 3), waypoint(4, 4)])
    first.start()
    second.start()
    for _ in range(20):
        rig.run(0.02)
        second.poll()
    assert second.result == ACCEPTED
    assert len(rig.station.missions.items) == 2
    while first.result is None:
        rig.run(0.02)
        first.poll()
    assert first.result == ACCEPTED
    assert same(download(two), SQUARE)


def test_items_out_of_turn_are_not_taken() -> None:
    rig = Rig()
    client = rig.client()
    upload = Uploader(client, SQUARE)
    upload.start()
    rig.run(0.04)
    for seq in (3, 1, 0, 0, 2, 1, 1, 3, 2, 3):
        upload.item(seq)
    rig.run(0.04)
    assert client.got("MISSION_ACK")[-1].type == ACCEPTED
    assert same(download(client), SQUARE)


def test_unknown_types_parts_and_lengths_are_answered() -> None:
    rig = Rig()
    client = rig.client()
    client.send(mavlink.MAVLink_mission_count_message(1, 1, 3, 3))
    client.send(mavlink.MAVLink_mission_write_partial_list_message(1, 1, 0, 1, 0))
    client.send(mavlink.MAVLink_mission_count_message(1, 1, 60000, 0))
    client.send(mavlink.MAVLink_mission_request_int_message(1, 1, 5, 0))
    rig.run(0.04)
    assert [a.type for a in client.got("MISSION_ACK")] == [
        mavlink.MAV_MISSION_UNSUPPORTED,
        mavlink.MAV_MISSION_UNSUPPORTED,
        mavlink.MAV_MISSION_NO_SPACE,
        mavlink.MAV_MISSION_INVALID_SEQUENCE,
    ]


def test_old_items_in_degrees() -> None:
    rig = Rig()
    client = rig.client()
    client.send(mavlink.MAVLink_mission_count_message(1, 1, 1, 0))
    client.send(
        mavlink.MAVLink_mission_item_message(1, 1, 0, 3, 16, 0, 1, 0, 0, 0, 0, ZURICH[0], ZURICH[1], 5.0, 0)
    )
    rig.run(0.04)
    assert client.got("MISSION_ACK")[-1].type == ACCEPTED
    (item,) = rig.station.missions.items
    assert item.x == pytest.approx(ZURICH[0] * 1e7, abs=40)  # a float's resolution
    client.send(mavlink.MAVLink_mission_request_message(1, 1, 0, 0))
    rig.run(0.04)
    assert client.got("MISSION_ITEM")[-1].x == pytest.approx(ZURICH[0], abs=4e-6)


def test_clear() -> None:
    for message in (
        mavlink.MAVLink_mission_clear_all_message(1, 1, 0),
        mavlink.MAVLink_mission_clear_all_message(1, 1, 255),
        mavlink.MAVLink_mission_count_message(1, 1, 0, 0),
    ):
        rig = Rig()
        client = rig.client()
        assert Uploader(client, SQUARE).run() == ACCEPTED
        client.send(message)
        rig.run(0.04)
        assert client.got("MISSION_ACK")[-1].type == ACCEPTED
        assert download(client) == []


# Flying


def flown(rig: Rig, client: Client, items: Items) -> list[int]:
    """Upload, take off, fly; the items reached."""
    assert Uploader(client, items).run() == ACCEPTED, client.texts()
    rig.fly(client)
    assert client.command(300, 0, 0).result == 0
    rig.run_until(lambda: rig.station.machine.mission.state != mavlink.MISSION_STATE_ACTIVE, 200)
    rig.run(2.0)
    return [m.seq for m in client.got("MISSION_ITEM_REACHED")]


def test_a_mission_is_flown_reported_and_ends_in_hold() -> None:
    rig = Rig()
    client = rig.client()
    assert flown(rig, client, SQUARE) == [0, 2, 3]
    assert rig.station.machine.mode.name == "HOLD"
    assert client.got("MISSION_CURRENT")[-1].mission_state == mavlink.MISSION_STATE_COMPLETE
    assert [m.seq for m in client.got("MISSION_CURRENT")] == sorted(
        m.seq for m in client.got("MISSION_CURRENT")
    )
    east, north, up = rig.view.position
    # Where the last way-point is, half a metre at most from where the vehicle would stop.
    assert (east, north, up - rig.station.machine.home[2]) == pytest.approx((8, 0, 6), abs=0.1)


def test_a_mission_from_the_ground_takes_off_first() -> None:
    rig = Rig()
    client = rig.client()
    assert Uploader(client, SQUARE).run() == ACCEPTED
    assert client.command(176, 1, 4, 4).result == 0
    assert client.command(400, 1).result == 0
    rig.run_until(lambda: rig.station.machine.mission.state == mavlink.MISSION_STATE_COMPLETE, 200)


def test_a_take_off_without_a_place_is_flown_to_its_height_where_the_vehicle_is() -> None:
    rig = Rig()
    client = rig.client()
    up = (6, *other(22)[1:9], 8.0)
    heights = []
    rig.before_step = lambda: heights.append(rig.view.position)
    assert flown(rig, client, [waypoint(4, 0), up, waypoint(4, 4)]) == [0, 1, 2]
    assert max(z for _, _, z in heights) == pytest.approx(8.0 + rig.station.machine.home[2], abs=1.0)
    reached = [(x, y) for x, y, z in heights if z > 6.5]
    assert reached[0] == pytest.approx((0.0, 4.0), abs=1.1)  # where the item before was reached


@pytest.mark.parametrize("command", [21, 22])
def test_take_off_and_landing_at_a_place_keep_the_load_off_the_ground_on_the_way(command: int) -> None:
    rig = Rig()
    client = rig.client()
    at = waypoint(4, 4, 0.0 if command == 21 else 0.5)
    item = (at[0], command, *at[2:])
    assert Uploader(client, [waypoint(4, 0), item, waypoint(4, 6)]).run() == ACCEPTED, client.texts()
    rig.fly(client)
    assert client.command(300, 0, 0).result == 0
    rig.run_until(lambda: bool(client.got("MISSION_ITEM_REACHED")))
    lowest = math.inf
    while 1 not in [m.seq for m in client.got("MISSION_ITEM_REACHED")]:
        rig.run(0.1)
        lowest = min(lowest, rig.view.load_position[2])
        assert rig.now < 300.0
    assert lowest > 0.4


def test_jumps_delays_return() -> None:
    rig = Rig()
    client = rig.client()
    items = [waypoint(4, 0), waypoint(4, 4), other(93, 1.5), other(177, 0, 2), other(20)]
    reached = flown(rig, client, items)
    assert reached == [0, 1, 2] * 3
    rig.run_until(lambda: not rig.station.armed, 100)
    assert rig.view.vehicle_on_ground


def test_a_loop_between_reached_points_is_left() -> None:
    rig = Rig()
    client = rig.client()
    flown(rig, client, [waypoint(3, 0), other(177, 0, -1)])
    assert "endless loop" in " ".join(client.texts())
    assert rig.station.machine.mode.name == "HOLD"


def test_pause_go_on_and_jump_to_an_item() -> None:
    rig = Rig()
    client = rig.client()
    assert Uploader(client, SQUARE).run() == ACCEPTED
    rig.fly(client)
    assert client.command(300, 0, 0).result == 0
    rig.run(1.0)
    assert client.command(193, 0).result == 0
    assert rig.station.machine.mission.state == mavlink.MISSION_STATE_PAUSED
    here = rig.view.position
    rig.run(5.0)
    assert math.dist(rig.view.position, here) < stopping_distance(3.0, 2.0) + 0.1
    client.send(mavlink.MAVLink_mission_set_current_message(1, 1, 3))
    rig.run(0.04)
    assert client.got("MISSION_CURRENT")[-1].seq == 3
    assert client.command(193, 1).result == 0
    rig.run_until(lambda: rig.station.machine.mission.state == mavlink.MISSION_STATE_COMPLETE, 60)
    assert [m.seq for m in client.got("MISSION_ITEM_REACHED")] == [3]
    client.send(mavlink.MAVLink_mission_set_current_message(1, 1, 9))
    rig.run(0.04)
    assert "does not exist" in client.texts()[-1]


def test_no_mission_no_start() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    for number, params in ((300, (0.0, 0.0)), (176, (1.0, 4.0, 4.0))):
        assert client.command(number, *params).result == 2
        assert "upload" in client.texts()[-1]
