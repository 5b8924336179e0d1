"""Signed links, checked against pymavlink's own signing."""

from __future__ import annotations

import itertools
import socket
import time
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.link.signing import EPOCH, KeyFileError, Signing, read_key
from controller.pilot.guided.link import GroundLink, GroundOptions, Ports
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.ground.rig import Client, Rig

KEY = bytes(range(32))
UNIX_AT_ZERO = 1.8e9
TICKS = 100_000


class Signer:
    """pymavlink as a client that signs."""

    def __init__(self, rig: Rig, key: bytes = KEY, system: int = 255) -> None:
        self.link = mavlink.MAVLink(None, srcSystem=system, srcComponent=190)
        self.link.signing.secret_key = key
        self.link.signing.sign_outgoing = True
        self.link.signing.link_id = 3
        self.link.signing.timestamp = int((rig.now + UNIX_AT_ZERO - EPOCH) * TICKS)

    def pack(self, message: Any) -> bytes:
        return bytes(message.pack(self.link))


def signed_rig() -> tuple[Rig, Client, Signer]:
    rig = Rig(signing=Signing(KEY, UNIX_AT_ZERO))
    return rig, rig.client(), Signer(rig)


def pings(client: Client) -> list[int]:
    return [m.seq for m in client.got("PING")]


def ping(seq: int) -> Any:
    return mavlink.MAVLink_ping_message(1, seq, 0, 0)


def test_signed_frames_are_taken_and_answered_signed() -> None:
    rig, client, signer = signed_rig()
    client.send_raw(signer.pack(ping(1)), signer.pack(ping(2)))
    rig.run(1.0)
    assert pings(client) == [1, 2]
    reader = mavlink.MAVLink(None)
    reader.signing.secret_key = KEY
    for raw in client.raw:
        assert raw[2] & 1
        if raw[7] | raw[8] << 8 not in mavlink.mavlink_map:
            continue  # a message of the newer dialect
        reader.decode(bytearray(raw))  # raises if pymavlink does not like the signature
    assert reader.signing.goodsig_count > 20
    assert reader.signing.badsig_count == 0


def test_unsigned_wrong_old_and_repeated_frames_are_refused() -> None:
    rig, client, signer = signed_rig()
    rig.clients[0].send(ping(1))  # unsigned
    client.send_raw(Signer(rig, key=bytes(32)).pack(ping(2)))  # another key
    good = signer.pack(ping(3))
    client.send_raw(good, good)  # replay
    broken = bytearray(signer.pack(ping(4)))
    broken[-1] ^= 1
    client.send_raw(bytes(broken))
    late = Signer(rig, system=254)
    late.link.signing.timestamp -= 61 * TICKS
    client.send_raw(late.pack(ping(5)))
    from pymavlink.dialects.v10 import common as v1

    client.send_raw(
        v1.MAVLink_ping_message(1, 6, 0, 0).pack(v1.MAVLink(None, srcSystem=255, srcComponent=190))
    )
    rig.run(0.1)
    assert pings(client) == [3]


def test_a_replay_from_another_address_or_link_is_refused() -> None:
    rig, client, signer = signed_rig()
    thief = rig.client(14540, link=1)
    recorded = signer.pack(ping(1))
    client.send_raw(recorded)
    thief.send_raw(recorded)
    rig.run(0.1)
    assert pings(client) == [1]
    assert not pings(thief)


def test_a_forged_time_stamp_does_not_lock_the_sender_out() -> None:
    """pymavlink takes over the time stamp of a frame before it checks the signature."""
    rig, client, signer = signed_rig()
    forged = bytearray(signer.pack(ping(1)))
    forged[-12:-6] = b"\xff" * 6
    client.send_raw(bytes(forged), signer.pack(ping(2)))
    rig.run(0.1)
    assert pings(client) == [2]


def test_an_unsigned_peer_is_not_even_remembered() -> None:
    rig, _, _ = signed_rig()
    rig.client(50000).heartbeat()
    assert len(list(rig.station.peers)) == 2


def time_stamps(client: Client) -> list[int]:
    return [int.from_bytes(raw[-12:-6], "little") for raw in client.raw]


def test_time_stamps_keep_to_the_time_of_day_and_never_go_back() -> None:
    signing = Signing(KEY, UNIX_AT_ZERO)
    rig = Rig(signing=signing)
    client = rig.client()
    rig.run(1.0)
    hour = 3600.0
    signing.keep_time(rig.now, rig.now + UNIX_AT_ZERO + hour)  # the machine slept
    rig.run(1.0)
    expected = (rig.now + UNIX_AT_ZERO + hour - EPOCH) * TICKS
    assert time_stamps(client)[-1] == pytest.approx(expected, abs=TICKS)
    recorded = Signer(rig, system=254)  # when the machine fell asleep
    client.send_raw(recorded.pack(ping(1)))
    signing.keep_time(rig.now, rig.now + UNIX_AT_ZERO)  # somebody has set the clock back
    rig.run(1.0)
    assert not pings(client)
    stamps = time_stamps(client)
    assert all(b > a for a, b in itertools.pairwise(stamps))


def test_a_links_time_stamps_are_the_time_of_day(tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_text(KEY.hex())
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.bind(("127.0.0.1", 0))
        client.settimeout(5.0)
        ports = Ports(0, client.getsockname()[1])
        options = GroundOptions(ports, Ports(0, 9), key)
        link = GroundLink(load_vehicle("iris"), 0, options, lambda text: None)
        link.serve(time.monotonic() + 600.0)  # the loop's clock is another one
        raw = client.recv(2048)
        link.close()
    stamp = int.from_bytes(raw[-12:-6], "little") / TICKS + EPOCH
    assert stamp == pytest.approx(time.time(), abs=5.0)


def test_keys_are_not_taken_over_a_link() -> None:
    rig = Rig()
    client = rig.client()
    client.send(mavlink.MAVLink_setup_signing_message(1, 1, [1] * 32, 0))
    rig.run(0.1)
    assert "--signing-key" in client.texts()[0]
    client.send(ping(1))
    rig.run(0.1)
    assert pings(client) == [1]


def test_key_files(tmp_path: Path) -> None:
    path = tmp_path / "key"
    path.write_text(KEY.hex() + "\n")
    assert read_key(path) == KEY
    for bad in ("", "00" * 31, "zz" * 32, "00" * 33):
        path.write_text(bad)
        with pytest.raises(KeyFileError, match="64 hexadecimal digits"):
            read_key(path)
    with pytest.raises(KeyFileError):
        read_key(tmp_path / "none")
