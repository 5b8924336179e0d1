"""A port of the view on which several speak."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator

import pytest

from sitl.flights.free_ports import free_ports
from sitl.view.many_senders import MOST_SENDERS, ManySenders
from sitl_bridge.mavlink.links.address import Address


@pytest.fixture
def address() -> Address:
    return Address("udpin", "127.0.0.1", free_ports(1)[0])


@pytest.fixture
def link(address: Address) -> Iterator[ManySenders]:
    opened = ManySenders(address)
    yield opened
    opened.close()


def speak(address: Address, text: bytes) -> socket.socket:
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sender.settimeout(10.0)
    sender.sendto(text, (address.host, address.port))
    return sender


def heard(link: ManySenders, count: int) -> list[bytes]:
    end = time.monotonic() + 10.0
    out: list[bytes] = []
    while len(out) < count and time.monotonic() < end:
        datagram = link.receive(end)
        out += [] if datagram is None else [datagram]
    return out


def test_everybody_is_heard_and_answered(address: Address, link: ManySenders) -> None:
    vehicle, plant = speak(address, b"vehicle"), speak(address, b"plant")
    with vehicle, plant:
        assert sorted(heard(link, 2)) == [b"plant", b"vehicle"]
        link.send(b"answer")
        assert vehicle.recv(100) == plant.recv(100) == b"answer"
        assert link.receive(0.0) is None


def test_the_one_silent_for_longest_is_forgotten(address: Address, link: ManySenders) -> None:
    senders = []
    try:
        for number in range(MOST_SENDERS + 1):
            senders.append(speak(address, b"%d" % number))
            assert heard(link, 1) == [b"%d" % number]
        link.send(b"answer")
        assert all(sender.recv(100) == b"answer" for sender in senders[1:])
        senders[0].setblocking(False)
        with pytest.raises(BlockingIOError):
            senders[0].recv(100)
    finally:
        for sender in senders:
            sender.close()


def test_a_port_in_use_is_named(address: Address, link: ManySenders) -> None:
    with pytest.raises(OSError, match=str(address)):
        ManySenders(address)
