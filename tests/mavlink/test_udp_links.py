"""UDP links on loopback: whom a waiting link hears and answers, in which order, and who gets its port."""

from __future__ import annotations

import errno
import socket
import time
from collections.abc import Iterator

import pytest

from sitl_bridge.mavlink.links import udp
from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.mavlink.links.udp import UdpLink
from tests.patience import PATIENCE


@pytest.fixture(params=["coarse", "punctual", "one socket on a port"])
def link(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[UdpLink]:
    if request.param == "one socket on a port":

        def refuse(*_: object) -> None:
            raise OSError(errno.EADDRINUSE, "as on other systems")

        monkeypatch.setattr(udp, "_beside", refuse)
    opened = UdpLink(Address("udpin", "127.0.0.1", 0), punctual=request.param == "punctual")
    yield opened
    opened.close()


@pytest.fixture
def peers(link: UdpLink) -> Iterator[list[socket.socket]]:
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    for one in sockets:
        one.connect(("127.0.0.1", link.port))
        one.settimeout(PATIENCE)
    yield sockets
    for one in sockets:
        one.close()


def heard(link: UdpLink) -> bytes:
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        datagram = link.receive(time.monotonic() + 0.02)
        if datagram is not None:
            return datagram
    raise AssertionError("heard nothing")


def test_a_peer_is_heard_in_order_and_answered(link: UdpLink, peers: list[socket.socket]) -> None:
    link.send(b"nobody is there yet")
    sent = [b"%d" % k for k in range(20)]
    for datagram in sent[:10]:
        peers[0].send(datagram)
    first = heard(link)
    for datagram in sent[10:]:
        peers[0].send(datagram)
    assert [first, *(heard(link) for _ in sent[1:])] == sent
    link.send(b"answer")
    assert peers[0].recv(100) == b"answer"
    assert link.receive(time.monotonic()) is None


def test_whoever_takes_over_is_heard_and_answered(link: UdpLink, peers: list[socket.socket]) -> None:
    for turn in range(4):
        peers[turn % 2].send(b"%d" % turn)
        assert heard(link) == b"%d" % turn
        link.send(b"answer %d" % turn)
        assert peers[turn % 2].recv(100) == b"answer %d" % turn
    peers[1].close()  # the latest: it refuses what is sent to it
    for _ in range(3):
        link.send(b"lost")
        link.receive(time.monotonic() + 0.01)
    peers[0].send(b"back")
    assert heard(link) == b"back"


def test_nobody_comes_between_while_the_peer_speaks() -> None:
    link = UdpLink(Address("udpin", "127.0.0.1", 0))
    peer, stranger = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    try:
        for one in (peer, stranger):
            one.connect(("127.0.0.1", link.port))
        peer.settimeout(PATIENCE)
        peer.send(b"0")
        assert heard(link) == b"0"
        for k in range(1, 10):
            stranger.send(b"stranger")
            peer.send(b"%d" % k)
            assert heard(link) == b"%d" % k
            link.send(b"answer")
            assert peer.recv(100) == b"answer"
        assert heard(link) == b"stranger"  # when the peer pauses
    finally:
        for one in (link, peer, stranger):
            one.close()


def test_the_port_is_the_links_alone(link: UdpLink, peers: list[socket.socket]) -> None:
    for _ in range(2):  # before and after somebody has spoken
        with pytest.raises(OSError, match=f"udpin:127.0.0.1:{link.port} cannot be opened"):
            UdpLink(Address("udpin", "127.0.0.1", link.port))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as thief:
            thief.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            with pytest.raises(OSError, match="in use"):
                thief.bind(("127.0.0.1", link.port))
        peers[0].send(b"here")
        assert heard(link) == b"here"
    port = link.port
    link.close()
    UdpLink(Address("udpin", "127.0.0.1", port)).close()
