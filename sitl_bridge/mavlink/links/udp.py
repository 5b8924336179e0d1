"""Datagrams over UDP."""

from __future__ import annotations

import contextlib
import math
import select
import socket
import struct
import time
from collections import deque

from sitl_bridge.mavlink.framing import LARGEST_DATAGRAM
from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.mavlink.links.link import LONGEST_WAIT

RECEIVE_BUFFER = 1 << 20
"""Bytes."""
COARSE_WAIT = 0.005
"""Grain of the socket's own time-out, s: too coarse for a tick's deadline, one system call less otherwise."""
PRECISE_RECEIVES = 1000
"""After a short deadline that passed in vain, so many deadlines are kept to the microsecond."""


def _udp_socket() -> socket.socket:
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
    return opened


def _beside(listener: socket.socket, peer: tuple[str, int]) -> socket.socket:
    """A second socket on the port, connected to a peer; nobody else gets the port. Raises OSError."""
    second = _udp_socket()
    try:
        for one in (listener, second):
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        second.bind(listener.getsockname())
        second.connect(peer)
    except OSError:
        second.close()
        raise
    finally:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 0)
    second.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 0)
    return second


class UdpLink:
    """UDP to one peer: a fixed one (`udpout`), or whoever speaks first, and after a pause another (`udpin`).

    Datagrams go through a socket that is connected to the peer: they need no addresses, and nobody else is
    heard in between. On a `udpin` link a second socket on the same port has what others send, for the pause.
    """

    reliable = False

    def __init__(self, address: Address, punctual: bool = False) -> None:
        """Raises OSError, naming the address, when the port is taken or the host unknown.

        punctual: `receive` returns within microseconds of its deadline, at the price of a system call.
        """
        self._punctual = punctual
        self._precise_left = 0  # receives that keep a short deadline precisely, because datagrams were lost
        self._timeout = 0.0
        self._peer: tuple[str, int] | None = None
        self._listener: socket.socket | None = None
        self._waiting: deque[bytes] = deque()
        self._socket = _udp_socket()
        try:
            if address.kind == "udpout":
                self._peer = (socket.gethostbyname(address.host), address.port)
                self._socket.bind(("127.0.0.1" if self._peer[0].startswith("127.") else "", 0))
                self._socket.connect(self._peer)
            else:
                self._socket.bind((address.host, address.port))
                self._listener = self._socket
        except OSError as error:
            self._socket.close()
            raise OSError(f"{address} cannot be opened: {error.strerror or error}") from None

    @property
    def port(self) -> int:
        """The local port."""
        return int(self._socket.getsockname()[1])

    def send(self, datagram: bytes) -> None:
        """Send to the peer; what the system cannot deliver is lost, as on any network."""
        try:
            if self._socket is not self._listener:
                self._socket.send(datagram)
            elif self._peer is not None:
                self._socket.sendto(datagram, self._peer)
        except OSError:
            return

    def receive(self, until: float) -> bytes | None:
        """The next datagram, or None when `time.monotonic()` reaches `until` first."""
        if self._waiting:
            return self._waiting.popleft()
        wait = min(until - time.monotonic(), LONGEST_WAIT)
        flags = 0
        precise = self._punctual or self._precise_left > 0
        if precise or wait <= 0.0:
            flags = int(socket.MSG_DONTWAIT)
            self._precise_left = max(0, self._precise_left - 1)
            if wait > 0.0 and not select.select([self._socket], [], [], wait)[0]:
                self._missed(wait)
                return self._from_another()
        elif not self._timeout - COARSE_WAIT < wait <= self._timeout:
            self._set_timeout(wait)
        try:
            if self._socket is not self._listener:
                return self._socket.recv(LARGEST_DATAGRAM, flags)
            datagram, peer = self._socket.recvfrom(LARGEST_DATAGRAM, flags)
        except OSError:  # nothing came, or an earlier datagram could not be delivered
            self._missed(wait)
            return self._from_another()
        self._follow(peer)
        return datagram

    def _missed(self, wait: float) -> None:
        """A short deadline passed: this link loses datagrams, and its deadlines are worth a system call."""
        if 0.0 < wait < COARSE_WAIT:
            self._precise_left = PRECISE_RECEIVES

    def _from_another(self) -> bytes | None:
        """The peer pauses: what somebody else has sent to a `udpin` link, who is the peer from now on."""
        if self._listener is None or self._socket is self._listener:
            return None
        try:
            datagram, peer = self._listener.recvfrom(LARGEST_DATAGRAM, socket.MSG_DONTWAIT)
        except OSError:
            return None
        self._follow(peer)
        return datagram

    def _follow(self, peer: tuple[str, int]) -> None:
        """Connect a socket to a new peer; where the system does not have two on a port, one has to do."""
        if peer == self._peer or self._listener is None:
            return
        self._peer = peer
        if self._socket is not self._listener:
            self._socket.close()
        self._socket, self._timeout = self._listener, 0.0
        with contextlib.suppress(OSError):
            self._socket = _beside(self._listener, peer)
            while True:  # until the listener has no more: what the peer had sent before is heard in turn
                datagram, sender = self._listener.recvfrom(LARGEST_DATAGRAM, socket.MSG_DONTWAIT)
                if sender == peer:
                    self._waiting.append(datagram)

    def _set_timeout(self, wait: float) -> None:
        coarse = math.ceil(wait / COARSE_WAIT) * COARSE_WAIT
        if coarse != self._timeout:
            self._timeout = coarse
            value = struct.pack("ll", int(coarse), int(coarse % 1.0 * 1e6))
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, value)

    def close(self) -> None:
        """Free the port."""
        self._socket.close()
        if self._listener is not None:
            self._listener.close()
