"""Sockets that carry datagrams of MAVLink frames, and the addresses that people give for them."""

from __future__ import annotations

import contextlib
import math
import select
import socket
import struct
import time
from collections import deque
from collections.abc import Callable
from typing import Literal, NamedTuple, Protocol

from sitl_bridge.mavlink.framing import LARGEST_DATAGRAM, Frame, StreamSplitter
from sitl_bridge.mavlink.hil import HIL_SENSOR

RECEIVE_BUFFER = 1 << 20
KINDS = ("udpout", "udpin", "tcpin", "tcpout")
Kind = Literal["udpout", "udpin", "tcpin", "tcpout", "serial"]

COARSE_WAIT = 0.005
"""Grain of the socket's own time-out, s: too coarse for a tick's deadline, one system call less otherwise."""
PRECISE_RECEIVES = 1000
"""After a short deadline that passed in vain, so many deadlines are kept to the microsecond."""
LONGEST_WAIT = 0.1
"""A wait is cut to this (s), so that a process notices soon that it is asked to stop."""


class Address(NamedTuple):
    """Where a link goes: `udpout:HOST:PORT` sends there first, `udpin:` waits there, likewise for TCP."""

    kind: Kind
    host: str
    """Of a serial line: its device."""
    port: int
    """Of a serial line: its baud rate."""

    def __str__(self) -> str:
        return f"{self.kind}:{self.host}:{self.port}"


def possible_host(text: str) -> bool:
    """Whether this may be a host's name or address; what has an empty label is neither, and no lookup."""
    try:
        return bool(text.encode("idna"))
    except UnicodeError:
        return False


def parse_address(text: str, udp_port: int | None = None, tcp_port: int | None = None) -> Address:
    """Parse `udpout:HOST:PORT | udpin:… | tcpin:… | tcpout:…`; raises ValueError with what was expected.

    udp_port, tcp_port: of an address that names none (`tcpin:HOST`, `tcpin`); without a host: 127.0.0.1.
    """
    kind, _, rest = text.partition(":")
    host, _, port = rest.rpartition(":")
    default = tcp_port if kind.startswith("tcp") else udp_port
    if ":" not in rest and default is not None:
        host, port = rest or "127.0.0.1", str(default)
    if kind not in KINDS or not possible_host(host) or not port.isdecimal() or not 0 <= int(port) <= 65535:
        raise ValueError(f"{text!r}: expected {'|'.join(KINDS)}:HOST:PORT, as in udpout:127.0.0.1:14560")
    return Address(kind, host, int(port))  # type: ignore[arg-type]  # just checked against KINDS


USUAL_BAUD = 921_600
"""PX4's for a companion computer."""


def parse_stack_address(text: str, udp_port: int, tcp_port: int) -> Address:
    """`parse_address`, and `serial:DEVICE[:BAUD]` besides; raises ValueError."""
    kind, _, rest = text.partition(":")
    if kind != "serial":
        try:
            return parse_address(text, udp_port, tcp_port)
        except ValueError as error:
            raise ValueError(f"{error}, or serial:DEVICE:BAUD") from None
    device, colon, baud = rest.rpartition(":")
    if not colon:
        device, baud = rest, str(USUAL_BAUD)
    if not device or not baud.isdecimal() or not int(baud):
        raise ValueError(f"{text!r}: expected serial:DEVICE:BAUD, as in serial:/dev/ttyACM0:{USUAL_BAUD}")
    return Address("serial", device, int(baud))


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


RETRY_INTERVAL = 0.2
"""Between two attempts of a client to connect, s."""
MOST_UNSENT = 1 << 16
"""Bytes that wait for a slow peer before further datagrams are lost."""


class TcpLink:
    """TCP with one peer at a time: `tcpin` waits for clients, `tcpout` connects, and tries again.

    A stream has no datagrams, so `receive` cuts it: whole frames, as many as there are. A stream that carries
    HIL_SENSOR is cut behind each of them, so that a tick comes in one piece, however the network broke it up.
    """

    reliable = True

    def __init__(self, address: Address, say: Callable[[str], None]) -> None:
        """Raises OSError, naming the address, when the port is taken or the host unknown."""
        self._address = address
        self._say = say
        self._listener: socket.socket | None = None
        self._peer: socket.socket | None = None
        self._connecting: socket.socket | None = None
        self._next_attempt = 0.0
        self._last_sent = b""
        self._junk_said = False
        self._unsent = b""
        self._clear()
        try:
            self._target = (socket.gethostbyname(address.host), address.port)
            if address.kind == "tcpin":
                self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
                self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                self._listener.setblocking(False)
                self._listener.bind(self._target)
                self._listener.listen(1)
        except OSError as error:
            self.close()
            raise OSError(f"{address} cannot be opened: {error.strerror or error}") from None

    @property
    def port(self) -> int:
        """The local port of a server."""
        assert self._listener is not None
        return int(self._listener.getsockname()[1])

    @property
    def connected(self) -> bool:
        """Whether there is a peer."""
        return self._peer is not None

    def send(self, datagram: bytes) -> None:
        """Send to the peer; without one, or to one that takes no more, the datagram is lost."""
        self._last_sent = datagram
        if self._peer is not None and len(self._unsent) < MOST_UNSENT:
            self._unsent += datagram
            self._flush()

    def receive(self, until: float) -> bytes | None:
        """Whole frames, or None when `time.monotonic()` reaches `until` first, or after LONGEST_WAIT."""
        until = min(until, time.monotonic() + LONGEST_WAIT)
        while not self._ready:
            if self._peer is None:
                self._seek_peer(until)
            else:
                self._read(until)
            if time.monotonic() >= until:
                break
        return self._ready.popleft() if self._ready else None

    def close(self) -> None:
        """Free the port."""
        for one in (self._listener, self._peer, self._connecting):
            if one is not None:
                one.close()
        self._listener = self._peer = self._connecting = None

    def _clear(self) -> None:
        """Nothing of an earlier peer's stream is left."""
        self._splitter = StreamSplitter()
        self._frames: list[bytes] = []
        self._by_tick = False
        self._ready: deque[bytes] = deque()
        self._unsent = b""

    def _seek_peer(self, until: float) -> None:
        if self._listener is not None:
            self._accept(until)
        else:
            self._connect(until)

    def _accept(self, until: float) -> None:
        assert self._listener is not None
        if not select.select([self._listener], [], [], max(0.0, until - time.monotonic()))[0]:
            return
        try:
            peer, _ = self._listener.accept()
        except OSError:  # gone again before it was let in
            return
        self._take(peer)

    def _connect(self, until: float) -> None:
        if self._connecting is None:
            wait = min(self._next_attempt, until) - time.monotonic()
            if wait > 0.0:
                time.sleep(wait)
            if time.monotonic() < self._next_attempt:
                return
            self._next_attempt = time.monotonic() + RETRY_INTERVAL
            self._connecting = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            self._connecting.setblocking(False)
            self._connecting.connect_ex(self._target)
        attempt = self._connecting
        if not select.select([], [attempt], [], max(0.0, until - time.monotonic()))[1]:
            return
        self._connecting = None
        if attempt.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            attempt.close()
        else:
            self._take(attempt)

    def _take(self, peer: socket.socket) -> None:
        peer.setblocking(False)
        peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._clear()
        self._peer = peer
        self._say(f"connected on {self._address}")
        # What was said while nobody listened was lost; a lockstep partner waits for exactly the last of it.
        if self._last_sent:
            self.send(self._last_sent)

    def _lose(self) -> None:
        assert self._peer is not None
        self._peer.close()
        self._peer = None
        self._unsent = b""
        doing = "waiting for another" if self._listener is not None else "trying again"
        self._say(f"connection on {self._address} lost: {doing}")

    def _read(self, until: float) -> None:
        assert self._peer is not None
        writers = [self._peer] if self._unsent else []
        wait = max(0.0, until - time.monotonic())
        readable, writable, _ = select.select([self._peer], writers, [], wait)
        if writable:
            self._flush()
        if not readable or self._peer is None:
            return
        try:
            data = self._peer.recv(LARGEST_DATAGRAM // 2)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self._cut(self._splitter.receive(data))
            if self._splitter.junk and not self._junk_said:
                self._junk_said = True
                self._say(f"bytes on {self._address} that are no MAVLink `common` frames: ignored")
        else:
            self._lose()

    def _cut(self, frames: list[Frame]) -> None:
        for frame in frames:
            self._frames.append(frame.raw)
            if frame.message_id == HIL_SENSOR.message_id:
                self._by_tick = True
                self._hand_over()
        if not self._by_tick:
            self._hand_over()

    def _hand_over(self) -> None:
        if self._frames:
            self._ready.append(b"".join(self._frames))
            self._frames = []

    def _flush(self) -> None:
        assert self._peer is not None
        try:
            sent = self._peer.send(self._unsent)
        except BlockingIOError:
            return
        except OSError:
            self._lose()
            return
        self._unsent = self._unsent[sent:]


def open_link(address: Address, say: Callable[[str], None], punctual: bool = False) -> Link:
    """Open the link of an address. Raises OSError when a port or device is taken, a host unknown."""
    if address.kind in ("udpin", "udpout"):
        return UdpLink(address, punctual)
    if address.kind == "serial":
        from sitl_bridge.mavlink.serial_link import SerialLink

        return SerialLink(address.host, address.port, say)
    return TcpLink(address, say)
