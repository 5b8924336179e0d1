"""Sockets that carry datagrams of MAVLink frames, and the addresses that people give for them."""

from __future__ import annotations

import math
import select
import socket
import struct
import time
from collections.abc import Callable
from typing import Literal, NamedTuple, Protocol

LARGEST_DATAGRAM = 65536
RECEIVE_BUFFER = 1 << 20
KINDS = ("udpout", "udpin", "tcpin", "tcpout")
Kind = Literal["udpout", "udpin", "tcpin", "tcpout"]

COARSE_WAIT = 0.005
"""Grain of the socket's own time-out, s: too coarse for a tick's deadline, one system call less otherwise."""
LONGEST_WAIT = 0.1
"""A wait is cut to this (s), so that a process notices soon that it is asked to stop."""


class Address(NamedTuple):
    """Where a link goes: `udpout:HOST:PORT` sends there first, `udpin:` waits there, likewise for TCP."""

    kind: Kind
    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.kind}:{self.host}:{self.port}"


def parse_address(text: str) -> Address:
    """Parse `udpout:HOST:PORT | udpin:… | tcpin:… | tcpout:…`; raises ValueError with what was expected."""
    kind, _, rest = text.partition(":")
    host, _, port = rest.rpartition(":")
    if kind not in KINDS or not host or not port.isdigit() or not 0 <= int(port) <= 65535:
        raise ValueError(f"{text!r}: expected {'|'.join(KINDS)}:HOST:PORT, as in udpout:127.0.0.1:14560")
    return Address(kind, host, int(port))  # type: ignore[arg-type]  # just checked against KINDS


class Link(Protocol):
    """A datagram link to one peer."""

    reliable: bool
    """Whether the link itself repeats what is lost (TCP)."""

    def send(self, datagram: bytes) -> None:
        """Send to the peer; without a peer yet, or one that is gone, the datagram is lost."""

    def receive(self, until: float) -> bytes | None:
        """The next datagram; None when `time.monotonic()` reaches `until` first, or after LONGEST_WAIT."""

    def close(self) -> None:
        """Free the port."""


class UdpLink:
    """UDP to one peer: a fixed one (`udpout`), or whoever sent the latest datagram (`udpin`)."""

    reliable = False

    def __init__(self, address: Address, punctual: bool = False) -> None:
        """Raises OSError, naming the address, when the port is taken or the host unknown.

        punctual: `receive` returns within microseconds of its deadline, at the price of a system call.
        """
        self._punctual = punctual
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        self._fixed = address.kind == "udpout"
        self._peer: tuple[str, int] | None = None
        self._timeout = 0.0
        try:
            if self._fixed:
                self._peer = (socket.gethostbyname(address.host), address.port)
                self._socket.bind(("127.0.0.1" if self._peer[0].startswith("127.") else "", 0))
            else:
                self._socket.bind((address.host, address.port))
        except OSError as error:
            self._socket.close()
            raise OSError(f"{address} cannot be opened: {error.strerror or error}") from None

    @property
    def port(self) -> int:
        """The local port."""
        return int(self._socket.getsockname()[1])

    @property
    def peer(self) -> tuple[str, int] | None:
        """Where `send` sends to."""
        return self._peer

    def send(self, datagram: bytes) -> None:
        """Send to the peer; what the system cannot deliver is lost, as on any network."""
        if self._peer is not None:
            try:
                self._socket.sendto(datagram, self._peer)
            except OSError:
                return

    def receive(self, until: float) -> bytes | None:
        """The next datagram, or None when `time.monotonic()` reaches `until` first."""
        wait = min(until - time.monotonic(), LONGEST_WAIT)
        try:
            if self._punctual and wait > 0.0:
                if not select.select([self._socket], [], [], wait)[0]:
                    return None
                flags = int(socket.MSG_DONTWAIT)
            elif wait > 0.0:
                self._set_timeout(wait)
                flags = 0
            else:
                flags = socket.MSG_DONTWAIT
            datagram, sender = self._socket.recvfrom(LARGEST_DATAGRAM, flags)
        except OSError:  # nothing came, or an earlier datagram could not be delivered
            return None
        if not self._fixed:
            self._peer = sender
        return datagram

    def _set_timeout(self, wait: float) -> None:
        coarse = math.ceil(wait / COARSE_WAIT) * COARSE_WAIT
        if coarse != self._timeout:
            self._timeout = coarse
            value = struct.pack("ll", int(coarse), int(coarse % 1.0 * 1e6))
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, value)

    def close(self) -> None:
        """Free the port."""
        self._socket.close()


def open_link(address: Address, say: Callable[[str], None], punctual: bool = False) -> Link:
    """Open the link of an address. Raises OSError when the port is taken or the host unknown."""
    if address.kind in ("udpin", "udpout"):
        return UdpLink(address, punctual)
    raise OSError(f"{address}: TCP is not there yet")
