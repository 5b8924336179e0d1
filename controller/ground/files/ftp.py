"""MAVLink FTP, read-only: https://mavlink.io/en/services/ftp.html. Payloads in, payloads out.

What is changed by the request is refused, at once and by its right error. A request that comes again is
answered again by the same bytes.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

from controller.ground.files.virtual import Content, VirtualFiles, is_packed_parameters
from controller.ground.link.peers import Address

SIZE = 251
"""Bytes of a payload"""
DATA = 239
"""Bytes of data in one"""
BURST_AT_ONCE = 20
"""Parts of a burst sent each time"""
BURST_PAUSE = 0.01
"""s between two times: a client's socket buffer would overflow"""
MOST_SESSIONS = 16
"""Open files of all clients; another closes the oldest"""
LARGEST_CHECKED = 4_000_000
"""Bytes of a file whose CRC-32 is worked out; the control loop has no time for more"""
_HEADER = struct.Struct("<HBBBBBBI")
_ANSWERS = 128
"""Opcodes from here on are answers: two ends that refuse each other's refusals would never stop"""


class Opcode(IntEnum):
    """Of requests and answers."""

    NONE = 0
    TERMINATE_SESSION = 1
    RESET_SESSIONS = 2
    LIST_DIRECTORY = 3
    OPEN_FILE_RO = 4
    READ_FILE = 5
    CREATE_FILE = 6
    WRITE_FILE = 7
    REMOVE_FILE = 8
    CREATE_DIRECTORY = 9
    REMOVE_DIRECTORY = 10
    OPEN_FILE_WO = 11
    TRUNCATE_FILE = 12
    RENAME = 13
    CALC_FILE_CRC32 = 14
    BURST_READ_FILE = 15
    ACK = 128
    NAK = 129


class Error(IntEnum):
    """Of a NAK."""

    FAIL = 1
    INVALID_DATA_SIZE = 3
    INVALID_SESSION = 4
    END_OF_FILE = 6
    UNKNOWN_COMMAND = 7
    FILE_PROTECTED = 9
    FILE_NOT_FOUND = 10


_WRITING = (
    *(Opcode.CREATE_FILE, Opcode.WRITE_FILE, Opcode.REMOVE_FILE, Opcode.CREATE_DIRECTORY),
    *(Opcode.REMOVE_DIRECTORY, Opcode.OPEN_FILE_WO, Opcode.TRUNCATE_FILE, Opcode.RENAME),
)


class Client(NamedTuple):
    """Who asks."""

    peer: Address
    system: int
    component: int


class Request(NamedTuple):
    """A payload taken apart."""

    sequence: int
    session: int
    opcode: int
    size: int
    requested: int
    burst_complete: int
    padding: int
    offset: int
    data: bytes

    @property
    def path(self) -> str:
        """The data as a path."""
        return self.data.split(b"\0")[0].decode("ascii", "replace")


class _Burst(NamedTuple):
    session: int
    offset: int
    size: int
    """Bytes of each part"""
    sequence: int
    """Of the next part"""
    due: float


class Ftp:
    """Sessions of all clients."""

    def __init__(self, files: VirtualFiles) -> None:
        self._files = files
        self._open: dict[tuple[Client, int], Content] = {}
        """The oldest first"""
        self._last: dict[Client, tuple[bytes, bytes]] = {}
        """The last request and its answer"""
        self._bursts: dict[Client, _Burst] = {}
        self.packed_readers: set[Address] = set()
        """Peers that have read the packed parameters: they set every one as a float, as on ArduPilot"""

    def receive(self, payload: bytes, client: Client, now: float) -> bytes | None:
        """A request's answer; None for what is none, and for a burst, which `to_send` has."""
        header: tuple[int, int, int, int, int, int, int, int] = _HEADER.unpack_from(payload)
        request = Request(*header, payload[_HEADER.size : SIZE])
        if request.opcode >= _ANSWERS:
            return None
        request = request._replace(data=request.data[: request.size])
        last = self._last.get(client)
        if last is not None and last[0] == payload and request.opcode != Opcode.BURST_READ_FILE:
            return last[1]
        found = self._answer(request, client, now)
        if found is None:
            return None
        answer = found if isinstance(found, bytes) else _nak(request, found)
        self._last[client] = (payload, answer)
        return answer

    def forget(self, peer: Address) -> None:
        """A peer is gone."""
        self.packed_readers.discard(peer)
        for key in [key for key in self._open if key[0].peer == peer]:
            del self._open[key]
        for client in [client for client in (*self._last, *self._bursts) if client.peer == peer]:
            self._last.pop(client, None)
            self._bursts.pop(client, None)

    def _answer(self, request: Request, client: Client, now: float) -> bytes | Error | None:
        opcode = request.opcode
        if opcode in (Opcode.NONE, Opcode.RESET_SESSIONS, Opcode.TERMINATE_SESSION):
            self._close(request, client)
            return _ack(request)
        if request.size > DATA:
            return Error.INVALID_DATA_SIZE
        if opcode in _WRITING:
            return Error.FILE_PROTECTED
        if opcode == Opcode.LIST_DIRECTORY:
            return self._list(request)
        if opcode == Opcode.OPEN_FILE_RO:
            return self._open_file(request, client)
        if opcode == Opcode.CALC_FILE_CRC32:
            content = self._files.open(request.path)
            if content is None:
                return Error.FILE_NOT_FOUND
            if content.size > LARGEST_CHECKED:
                return Error.FAIL
            return _ack(request, struct.pack("<I", zlib.crc32(content.read(0, content.size))))
        if opcode not in (Opcode.READ_FILE, Opcode.BURST_READ_FILE):
            return Error.UNKNOWN_COMMAND
        content = self._open.get((client, request.session))
        if content is None:
            return Error.INVALID_SESSION
        if request.offset >= content.size:
            return Error.END_OF_FILE
        size = request.size or DATA
        if opcode == Opcode.READ_FILE:
            return _ack(request, content.read(request.offset, size))
        first = request.sequence + 1 & 0xFFFF
        self._bursts[client] = _Burst(request.session, request.offset, size, first, now)
        return None

    def _close(self, request: Request, client: Client) -> None:
        if request.opcode == Opcode.TERMINATE_SESSION:
            self._open.pop((client, request.session), None)
        elif request.opcode == Opcode.RESET_SESSIONS:
            for key in [key for key in self._open if key[0] == client]:
                del self._open[key]
        if request.opcode != Opcode.NONE:
            self._bursts.pop(client, None)

    def _list(self, request: Request) -> bytes | Error:
        entries = self._files.entries(request.path)
        if entries is None:
            return Error.FILE_NOT_FOUND
        if request.offset >= len(entries):
            return Error.END_OF_FILE
        data = b""
        for entry in entries[request.offset :]:
            line = f"D{entry.name}" if entry.size is None else f"F{entry.name}\t{entry.size}"
            raw = line.encode("ascii", "replace") + b"\0"
            if len(data) + len(raw) > DATA:
                break
            data += raw
        return _ack(request, data)

    def _open_file(self, request: Request, client: Client) -> bytes | Error:
        content = self._files.open(request.path)
        if content is None:
            return Error.FILE_NOT_FOUND
        if is_packed_parameters(request.path):
            self.packed_readers.add(client.peer)
        taken = {session for owner, session in self._open if owner == client}
        # MAVProxy chooses its session itself; others send 0 and take what they are given.
        free = next(number for number in range(MOST_SESSIONS + 1) if number not in taken)
        session = request.session or free
        self._open.pop((client, session), None)
        while len(self._open) >= MOST_SESSIONS:
            del self._open[next(iter(self._open))]
        self._open[client, session] = content
        return _ack(request._replace(session=session), struct.pack("<I", content.size))

    def to_send(self, known: Callable[[Address], bool], now: float) -> list[tuple[Client, bytes]]:
        """Parts of bursts that are due."""
        out: list[tuple[Client, bytes]] = []
        for client, burst in list(self._bursts.items()):
            content = self._open.get((client, burst.session))
            if content is None or not known(client.peer):
                del self._bursts[client]
            elif now >= burst.due:
                out += [(client, part) for part in self._parts(client, burst, content, now)]
        return out

    def _parts(self, client: Client, burst: _Burst, content: Content, now: float) -> list[bytes]:
        parts: list[bytes] = []
        whole = content.read(burst.offset, BURST_AT_ONCE * burst.size)
        for number in range(BURST_AT_ONCE):
            data = whole[number * burst.size : (number + 1) * burst.size]
            after = burst.offset + len(data)
            done = not data or after >= content.size
            header = (burst.sequence, burst.session, Opcode.ACK, len(data), Opcode.BURST_READ_FILE, done, 0)
            parts.append((_HEADER.pack(*header, burst.offset) + data).ljust(SIZE, b"\0"))
            burst = burst._replace(offset=after, sequence=burst.sequence + 1 & 0xFFFF, due=now + BURST_PAUSE)
            if done:
                del self._bursts[client]
                return parts
        self._bursts[client] = burst
        return parts

    def next_deadline(self) -> float:
        """When a part of a burst is due; inf if none is."""
        return min((burst.due for burst in self._bursts.values()), default=math.inf)


def _ack(request: Request, data: bytes = b"") -> bytes:
    return _answer(request, Opcode.ACK, data)


def _nak(request: Request, error: Error) -> bytes:
    return _answer(request, Opcode.NAK, bytes((error,)))


def _answer(request: Request, opcode: Opcode, data: bytes) -> bytes:
    sequence = request.sequence + 1 & 0xFFFF
    header = (sequence, request.session, opcode, len(data), request.opcode, 0, 0, request.offset)
    return (_HEADER.pack(*header) + data).ljust(SIZE, b"\0")
