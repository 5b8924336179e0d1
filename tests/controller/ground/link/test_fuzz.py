"""No datagram can crash, wedge or arm the vehicle."""

from __future__ import annotations

import math
import random
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.link.packing import frame
from controller.pilot.guided.log_folder import LogFolder
from tests.controller.ground.rig import NAN, Channel, Rig

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
    "FOLLOW_TARGET",
    "MANUAL_CONTROL",
    "LOG_",
    "SERIAL_CONTROL",
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


@pytest.mark.parametrize("seed", range(6))
def test_random_plans_of_likely_items(seed: int) -> None:
    """Whatever is uploaded is answered once, and what is accepted can be flown or flown under."""
    generator = random.Random(2000 + seed)
    of_mission = [16, 17, 19, 20, 21, 22, 31, 93, 94, 112, 177, 178, 179, 195, 196, 197, 201, 211]
    commands = [of_mission, [5000, 5001, 5002, 5003, 5004], [5100]]
    rig = Rig()
    client = rig.client()
    rig.fly(client)
    for _ in range(60):
        kind, count = generator.randrange(3), generator.randrange(1, 6)
        client.clear()
        client.send(mavlink.MAVLink_mission_count_message(1, 1, count, kind))
        for seq in range(count):
            numbers = [generator.choice([*SPICE, 3.0, 4.0]) for _ in range(4)]
            x, y = (centre + generator.randrange(-20000, 20000) for centre in (473977420, 85455940))
            command = generator.choice(commands[kind])
            fields = (seq, 6, command, generator.choice((0, 1)), 1, *numbers, x, y)
            z = generator.choice([*SPICE, 5.0, 8.0])
            client.send(mavlink.MAVLink_mission_item_int_message(1, 1, *fields, z, kind))
        rig.run(0.04)
        assert len(client.got("MISSION_ACK")) == 1
        client.command(300, 0, 0)
        rig.run(generator.choice((0.02, 1.0)))
    client.clear()
    client.send(mavlink.MAVLink_ping_message(1, 77, 0, 0))
    rig.run(1.5)
    assert client.got("PING")
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
        34,
        35,
        179,
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


@pytest.mark.parametrize("seed", range(4))
def test_any_request_for_files(seed: int, tmp_path: Path) -> None:
    """FTP payloads with likely numbers and paths, and requests for logs, while something is under way."""
    generator = random.Random(2000 + seed)
    (tmp_path / "states.parquet").write_bytes(generator.randbytes(5000))
    rig = Rig(logs=LogFolder(tmp_path))
    clients = [rig.client(channel=Channel(0.1, 0.1, 0.1, seed)), rig.client(14540, link=1)]
    paths = [
        b"/",
        b"/log/states.parquet",
        b"@PARAM/param.pck",
        b"/etc/extras/parameters.json",
        b"..",
        b"\xff\0",
    ]
    for _ in range(1500):
        data = generator.choice(paths) + generator.randbytes(generator.choice((0, 0, 0, 5, 200)))
        size = generator.choice((len(data) & 0xFF, generator.randrange(256)))
        opcode = generator.choice((*range(17), 128, 129, 200, 255))
        offset = generator.choice((0, 0, 1, 239, 4999, 5000, 0xFFFFFFFF, generator.randrange(6000)))
        header = struct.pack(
            "<HBBBBBBI", generator.randrange(0x10000), generator.randrange(4), opcode, size, 0, 0, 0, offset
        )
        payload = (header + data)[:251].ljust(251, b"\0")
        number, count = generator.choice((0, 0, 1, 0xFFFF)), generator.choice((0, 90, 5000, 0xFFFFFFFF))
        generator.choice(clients).send(
            generator.choice(
                (
                    mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, payload),
                    mavlink.MAVLink_log_request_data_message(1, 1, number, offset, count),
                    mavlink.MAVLink_log_request_list_message(1, 1, 0, number),
                )
            )
        )
        if generator.random() < 0.2:
            rig.run(0.02)
    assert all(len(peer.queue) <= 1000 for peer in rig.station.peers)
    alive(rig)


@pytest.mark.parametrize("seed", range(4))
def test_any_sticks_targets_and_attitudes_in_flight(seed: int) -> None:
    """Whatever they ask for, targets stay finite and the vehicle answers."""
    generator = random.Random(3000 + seed)
    rig = Rig()
    client = rig.client()
    rig.fly(client)
    modes = ((3, 0), (2, 0), (3, 1), (4, 8), (4, 3), (6, 0))
    kinds = (
        mavlink.MAVLink_manual_control_message,
        mavlink.MAVLink_follow_target_message,
        mavlink.MAVLink_set_attitude_target_message,
        mavlink.MAVLink_set_position_target_local_ned_message,
    )
    for _ in range(600):
        kind = generator.choice(kinds)
        payload = bytearray(generator.randbytes(kind.unpacker.size))
        for offset in range(0, len(payload) - 3, 4):
            if generator.random() < 0.5:
                struct.pack_into("<f", payload, offset, generator.choice(SPICE))
        values = kind.unpacker.unpack(bytes(payload))
        raw = bytearray(kind.unpacker.pack(*values))
        raw = raw[: -1 - generator.randrange(2)] if generator.random() < 0.3 else raw
        client.send_raw(frame(bytes(raw), kind.id, kind.crc_extra, 0, 255, 190, False))
        client.send(mavlink.MAVLink_manual_control_message(1, *(generator.choice((0, 500, 1000)),) * 4, 0))
        if generator.random() < 0.3:
            main, sub = generator.choice(modes)
            client.send(mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, main, sub, 0, 0, 0, 0))
        rig.run(0.02)
        numbers = [n for field in ("position", "velocity") for n in getattr(rig.target, field, ())]
        assert not any(math.isinf(n) for n in numbers)
    client.clear()
    client.send(mavlink.MAVLink_ping_message(1, 77, 0, 0))
    rig.run(1.5)
    assert [m.seq for m in client.got("PING")] == [77]


def test_a_flood_is_bounded() -> None:
    rig = Rig()
    client = rig.client()
    for _ in range(5_000 // 20):
        client.send(*[mavlink.MAVLink_command_long_message(1, 1, 512, 0, 148, *(0,) * 6)] * 20)
    assert all(len(peer.queue) <= 1000 for peer in rig.station.peers)
    alive(rig)
