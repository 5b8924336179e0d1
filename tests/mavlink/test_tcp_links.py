"""TCP links on loopback: whole frames from any pieces, new peers after a loss, no wait beyond `until`."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import common

from sitl_bridge.mavlink.framing import Packer, split
from sitl_bridge.mavlink.links.address import Address, parse_address
from sitl_bridge.mavlink.links.link import LONGEST_WAIT
from sitl_bridge.mavlink.links.opening import open_link
from sitl_bridge.mavlink.links.tcp import TcpLink
from tests.patience import PATIENCE

packer = Packer(1, 191)


def sensor(time_usec: int) -> bytes:
    return packer.pack(common.MAVLink_hil_sensor_message(time_usec, *[0.5] * 13, fields_updated=1))


def gps(time_usec: int) -> bytes:
    return packer.pack(common.MAVLink_hil_gps_message(time_usec, 3, *[1] * 12))


def wait_for(link: TcpLink) -> bytes:
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        received = link.receive(time.monotonic() + 0.5)
        if received is not None:
            return received
    raise AssertionError("nothing came")


def meet(link: TcpLink) -> None:
    deadline = time.monotonic() + PATIENCE
    while not link.connected:
        link.receive(time.monotonic() + 0.05)
        assert time.monotonic() < deadline


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def server(said: list[str]) -> Iterator[TcpLink]:
    link = TcpLink(Address("tcpin", "127.0.0.1", 0), said.append)
    yield link
    link.close()


def client_of(server: TcpLink) -> socket.socket:
    one = socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE)
    meet(server)
    return one


def test_pieces_become_whole_frames(server: TcpLink) -> None:
    heartbeat = packer.pack(common.MAVLink_heartbeat_message(2, 12, 0, 0, 0, 3))
    with client_of(server) as client:
        for i in range(len(heartbeat)):
            client.sendall(heartbeat[i : i + 1])
            if i + 1 < len(heartbeat):
                assert server.receive(time.monotonic() + 0.005) is None
        assert wait_for(server) == heartbeat


def test_a_tick_comes_in_one_piece_however_it_was_broken_up(server: TcpLink) -> None:
    ticks = [gps(k) + sensor(k) for k in range(1, 4)]
    with client_of(server) as client:
        client.sendall(ticks[0] + ticks[1][:70])
        assert wait_for(server) == ticks[0]
        assert (
            server.receive(time.monotonic() + 0.02) is None
        )  # the second's HIL_GPS waits for its HIL_SENSOR
        client.sendall(ticks[1][70:] + ticks[2])
        assert [wait_for(server), wait_for(server)] == ticks[1:]


def test_junk_is_passed_over_and_said(server: TcpLink, said: list[str]) -> None:
    with client_of(server) as client:
        client.sendall(b"\xfd hello" + sensor(1) + b"junk" + sensor(2))
        found = split(wait_for(server) + wait_for(server))
        assert found.junk == 0
        assert len(found.frames) == 2
    assert any("not MAVLink" in text for text in said)


def test_a_new_client_after_a_loss_gets_what_was_said_last(server: TcpLink) -> None:
    with client_of(server) as first:
        server.send(b"one")
        assert first.recv(10) == b"one"
    deadline = time.monotonic() + PATIENCE
    while server.connected:
        server.receive(time.monotonic() + 0.05)
        assert time.monotonic() < deadline
    server.send(b"two")  # nobody listens
    with client_of(server) as second:
        assert second.recv(10) == b"two"


def test_a_client_tries_until_a_server_is_there_and_again_after_a_loss(said: list[str]) -> None:
    first = TcpLink(Address("tcpin", "127.0.0.1", 0), said.append)
    port = first.port
    first.close()
    client = TcpLink(Address("tcpout", "127.0.0.1", port), said.append)
    try:
        assert client.receive(time.monotonic() + 0.05) is None
        for number in (1, 2):
            server = TcpLink(Address("tcpin", "127.0.0.1", port), said.append)
            deadline = time.monotonic() + PATIENCE
            while not (client.connected and server.connected):
                client.receive(time.monotonic() + 0.02)
                server.receive(time.monotonic() + 0.02)
                assert time.monotonic() < deadline
            server.send(sensor(number))
            assert wait_for(client) == split(server._last_sent).frames[0].raw
            server.close()
            while client.connected:
                client.receive(time.monotonic() + 0.02)
                assert time.monotonic() < deadline
    finally:
        client.close()
    assert any("trying again" in text for text in said)


def test_a_peer_that_does_not_read_blocks_nobody(server: TcpLink) -> None:
    with client_of(server):
        began = time.monotonic()
        for _ in range(20_000):
            server.send(b"x" * 1000)  # more than any buffer takes
        assert time.monotonic() - began < PATIENCE
        assert server.connected


def test_a_client_repeats_after_a_loss_what_it_said_last(said: list[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(PATIENCE)
        client = TcpLink(Address("tcpout", "127.0.0.1", server.getsockname()[1]), said.append)
        try:
            client.send(b"one")  # nobody listens yet
            for said_last in (b"one", b"two"):
                meet(client)
                peer, _ = server.accept()
                with peer:
                    peer.settimeout(PATIENCE)
                    assert peer.recv(10) == said_last
                deadline = time.monotonic() + PATIENCE
                while client.connected:
                    client.receive(time.monotonic() + 0.05)
                    assert time.monotonic() < deadline
                client.send(b"two")  # nobody listens any more
        finally:
            client.close()


@pytest.mark.parametrize("kind", ["tcpin", "tcpout"])
def test_waits_end_in_time_without_a_peer(kind: str) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    link = open_link(Address(kind, "127.0.0.1", port), lambda text: None)  # type: ignore[arg-type]
    try:
        for wait in (0.0, 0.03, 60.0):
            began = time.monotonic()
            assert link.receive(began + wait) is None
            assert time.monotonic() - began < min(wait, LONGEST_WAIT) + 1.0
        link.send(b"lost")
    finally:
        link.close()


def test_a_taken_port_is_named(server: TcpLink) -> None:
    with pytest.raises(OSError, match=rf"tcpin:127\.0\.0\.1:{server.port} cannot be opened"):
        open_link(Address("tcpin", "127.0.0.1", server.port), lambda text: None)


def test_ports_that_an_address_leaves_out() -> None:
    assert str(parse_address("tcpin", 14563, 4563)) == "tcpin:127.0.0.1:4563"
    assert str(parse_address("tcpout:10.0.0.1", 14563, 4563)) == "tcpout:10.0.0.1:4563"
    assert str(parse_address("udpin:127.0.0.1", 14563, 4563)) == "udpin:127.0.0.1:14563"
    assert str(parse_address("tcpin:127.0.0.1:1", 14563, 4563)) == "tcpin:127.0.0.1:1"
    with pytest.raises(ValueError, match="expected udpout"):
        parse_address("tcpin:127.0.0.1")


@pytest.mark.parametrize("host", ["[::1]", "::1"])
def test_an_ipv6_address_is_refused_as_such(host: str) -> None:
    with pytest.raises(ValueError, match="no IPv6"):
        parse_address(f"udpout:{host}:14560")
