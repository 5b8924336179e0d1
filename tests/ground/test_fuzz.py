"""No datagram can crash, wedge or arm the vehicle."""

from __future__ import annotations

import random
import struct
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.link.packing import frame
from tests.ground.rig import NAN, Channel, Rig

SPICE = [NAN, float("inf"), float("-inf"), -1.0, 0.0, 1.0, 2.0, 21196.0, 1e38, 0.5]
WORDS = [
    "PARAM",
    "MISSION",
    "COMMAND",
    "SET_",
    "PING",
    "TIMESYNC",
    "FILE_TRANSFER",
    "DATA_STREAM",
    "HEARTBEAT",
]
HANDLED = [
    name for name in dir(mavlink) if name.startswith("MAVLINK_MSG_ID_") and any(w in name for w in WORDS)
]
IDS = sorted({getattr(mavlink, name) for name in HANDLED if getattr(mavlink, name) in mavlink.mavlink_map})


def alive(rig: Rig) -> None:
    """Everything still works, and nobody has armed."""
    assert not rig.station.armed
    client = rig.client(51000)
    rig.now += 31.0  # whoever was there is forgotten
    rig.run(0.1)
    client.heartbeat()
    rig.run(1.0)
    client.send(mavlink.MAVLink_ping_message(1, 77, 0, 0))
    rig.run(0.1)
    assert [m.seq for m in client.got("PING")] == [77]
    assert len(client.got("HEARTBEAT")) >= 1


@given(st.lists(st.binary(max_size=600), max_size=20))
@settings(max_examples=40, deadline=None)
def test_any_bytes(datagrams: list[bytes]) -> None:
    rig = Rig()
    client = rig.client()
    for datagram in datagrams:
        client.send_raw(datagram)
        rig.run(0.02)
    alive(rig)


def random_frame(generator: random.Random) -> bytes:
    """A good frame of a message that somebody here handles, its fields anything, often addressed to us."""
    number = generator.choice(IDS)
    kind = mavlink.mavlink_map[number]
    size = kind.unpacker.size
    payload = bytearray(generator.randbytes(size))
    if generator.random() < 0.5:
        payload = bytearray(size)
    for offset in range(0, size - 3, 4):
        if generator.random() < 0.4:
            struct.pack_into("<f", payload, offset, generator.choice(SPICE))
    names = list(kind.ordered_fieldnames)
    if "target_system" in names and generator.random() < 0.8:
        values = list(kind.unpacker.unpack(bytes(payload)))
        lengths = [kind.lengths[i] if kind.lengths[i] else 1 for i in range(len(names))]
        for name, value in (("target_system", generator.choice((1, 101, 0))), ("target_component", 1)):
            if name in names:
                values[sum(lengths[: names.index(name)])] = value
        payload = bytearray(kind.unpacker.pack(*values))
    source = (generator.choice((255, 1, 7, 245)), generator.choice((190, 1, 0)))
    return frame(bytes(payload), number, kind.crc_extra, generator.randrange(256), *source, False)


def arms(raw: bytes) -> bool:
    """Whether this is a proper command to arm, which of course may arm."""
    from sitl_bridge.mavlink.framing import decode, split

    found = split(raw).frames
    if not found or found[0].message_id not in (75, 76):
        return False
    message: Any = decode(found[0])
    return bool(message.command == 400 and message.param1 == 1.0)


@pytest.mark.parametrize("seed", range(12))
def test_any_messages(seed: int) -> None:
    generator = random.Random(seed)
    rig = Rig()
    clients = [rig.client(channel=Channel(0.1, 0.1, 0.1, seed)), rig.client(14540, link=1), rig.client(50000)]
    for _ in range(1500):
        raw = random_frame(generator)
        if arms(raw):
            continue
        cut = generator.random()
        generator.choice(clients).send_raw(raw if cut < 0.9 else raw[: generator.randrange(len(raw))])
        if generator.random() < 0.2:
            rig.run(0.02)
    alive(rig)


@pytest.mark.parametrize("seed", range(6))
def test_any_messages_in_flight(seed: int) -> None:
    """In flight they may change what the vehicle does, as any client may, but not break it."""
    generator = random.Random(1000 + seed)
    rig = Rig()
    client = rig.client()
    rig.fly(client)
    for _ in range(800):
        client.send_raw(random_frame(generator))
        if generator.random() < 0.3:
            rig.run(0.02)
    rig.run(60.0)
    client.clear()
    client.send(mavlink.MAVLink_ping_message(1, 77, 0, 0))
    rig.run(1.5)
    assert [m.seq for m in client.got("PING")] == [77]
    assert client.got("HEARTBEAT")


def test_random_commands_with_likely_numbers() -> None:
    generator = random.Random(5)
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    numbers = [
        176,
        192,
        22,
        21,
        20,
        300,
        178,
        193,
        224,
        185,
        511,
        512,
        510,
        520,
        245,
        246,
        241,
        179,
        401,
        262,
        400,
    ]
    for _ in range(3000):
        number = generator.choice(numbers)
        params = [generator.choice([*SPICE, 4.0, 5.0, 6.0, 47.4, 8.5, 435.0, 30.0]) for _ in range(7)]
        if number == 400 and params[0] == 1.0:
            continue
        client.clear()
        client.send(mavlink.MAVLink_command_long_message(1, 1, number, 0, *params))
        rig.run(0.02)
        acks = client.got("COMMAND_ACK")
        assert len(acks) == 1, (number, params)
        assert acks[0].result == 0 or client.texts(), (number, params)
    alive(rig)


def test_a_flood_is_bounded() -> None:
    rig = Rig()
    client = rig.client()
    for _ in range(5_000 // 20):
        client.send(*[mavlink.MAVLink_command_long_message(1, 1, 512, 0, 148, *(0,) * 6)] * 20)
    assert all(len(peer.queue) <= 1000 for peer in rig.station.peers)
    alive(rig)
