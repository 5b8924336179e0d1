"""The live view beside a ground station: what that one uploads to a real vehicle is drawn."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from sitl.view.listener import Listener
from sitl.view.plan import plan_of
from sitl_bridge.mavlink.framing import Packer, decode, split
from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.mavlink.links.link import Link
from sitl_bridge.mavlink.links.opening import open_link
from tests.loopback.by_hand import ByHand
from tests.loopback.conftest import Process
from tests.patience import LONG_PATIENCE
from tests.sitl.view.test_plan import FENCE, HOME, MISSION, RALLY

STATION = Packer(245, 190)


def messages(link: Link) -> list[Any]:
    """What comes within a moment."""
    datagram = link.receive(time.monotonic() + 0.05)
    return [decode(frame) for frame in split(datagram or b"").frames]


def upload(link: Link, kind: int, items: Any) -> int:
    """As a ground station does; the result."""
    end = time.monotonic() + LONG_PATIENCE
    link.send(STATION.pack(mavlink.MAVLink_mission_count_message(1, 1, len(items), kind)))
    while time.monotonic() < end:
        for message in messages(link):
            if message.get_type() == "MISSION_ACK":
                return int(message.type)
            if message.get_type() == "MISSION_REQUEST_INT":
                item = items[message.seq]
                parts = (item.frame, item.command, 0, item.autocontinue, *item[3:], kind)
                reply = mavlink.MAVLink_mission_item_int_message(1, 1, message.seq, *parts)
                link.send(STATION.pack(reply))
    raise AssertionError("the upload does not end")


def test_what_a_station_uploads_is_drawn(start: Callable[..., Process]) -> None:
    at_home = ("home.latitude=47", "home.longitude=8", "home.altitude=400")
    settings = [part for setting in at_home for part in ("--set", setting)]
    vehicle = ByHand(start, both=("--vehicle", "iris", *settings))
    heartbeat = STATION.pack(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    links = [open_link(Address("udpout", "127.0.0.1", vehicle.gcs), print) for _ in range(2)]
    station, viewer = links
    listener, uploaded = Listener(HOME), False
    wanted = plan_of(MISSION, FENCE, RALLY, HOME)
    try:
        end = time.monotonic() + LONG_PATIENCE
        while listener.view.plan != wanted:
            now = time.monotonic()
            assert now < end, listener.view.plan
            for datagram in listener.to_send(now):
                viewer.send(datagram)
            datagram = viewer.receive(now + 0.05)
            if datagram is not None:
                listener.receive(datagram, now)
            if listener.view.mode is not None and not uploaded:
                uploaded = True
                station.send(heartbeat)
                results = [upload(station, k, items) for k, items in enumerate((MISSION, FENCE, RALLY))]
                assert results == [mavlink.MAV_MISSION_ACCEPTED] * 3
    finally:
        for link in links:
            link.close()
