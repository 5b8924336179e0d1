"""Datagrams over TCP."""

from __future__ import annotations

import select
import socket
import time
from collections import deque
from collections.abc import Callable

from sitl_bridge.mavlink.framing import LARGEST_DATAGRAM, Frame, StreamSplitter
from sitl_bridge.mavlink.hil import HIL_SENSOR
from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.mavlink.links.link import LONGEST_WAIT

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
                self._say(f"bytes on {self._address} that are not MAVLink `common` frames: ignored")
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
