"""Bytes <-> MAVLink frames, version 1 and 2, with checksum and recovery behind junk.

The library of messages is pymavlink's; this module only finds and wraps frames, compiled, because it
runs at every tick of the HIL link. A false start byte in front of a good frame never swallows it
(pymavlink's own parser, and PX4's, lose such a frame).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import common

from sitl_bridge.compiled import Buffer, entry_point, kernel

Bytes = NDArray[np.uint8]
Table = NDArray[np.int32]

MAGIC_V2 = 0xFD
MAGIC_V1 = 0xFE
HEADER_LENGTH_V2 = 10
HEADER_LENGTH_V1 = 6
CHECKSUM_LENGTH = 2
SIGNATURE_LENGTH = 13
FLAG_SIGNED = 0x01
LARGEST_FRAME = HEADER_LENGTH_V2 + 255 + CHECKSUM_LENGTH + SIGNATURE_LENGTH

# Columns of the table that `scan` fills, one row a frame.
START, STOP, MESSAGE_ID, SYSTEM, COMPONENT, PAYLOAD, PAYLOAD_LENGTH = range(7)
TABLE_COLUMNS = 7
LARGEST_DATAGRAM = 65536
MOST_FRAMES = LARGEST_DATAGRAM // (HEADER_LENGTH_V1 + CHECKSUM_LENGTH)
DATAGRAM = Buffer(np.uint8, (LARGEST_DATAGRAM,))
FRAME_TABLE = Buffer(np.int32, (MOST_FRAMES + 1, TABLE_COLUMNS))


def _crc_extra() -> NDArray[np.int16]:
    """Checksum seed by message number, -1 where the dialect has no such message."""
    table = np.full(max(common.mavlink_map) + 1, -1, dtype=np.int16)
    for number, message in common.mavlink_map.items():
        table[number] = message.crc_extra
    return table


_SLICES = 8


def _crc_tables() -> NDArray[np.int32]:
    """CRC-16/MCRF4XX (polynomial 0x1021, reflected): row k is of each byte with k zero bytes behind it."""
    table = np.zeros((_SLICES, 256), dtype=np.int32)
    for byte in range(256):
        value = byte
        for row in range(_SLICES):
            for _ in range(8):
                value = value >> 1 ^ (0x8408 if value & 1 else 0)
            table[row, byte] = value
    return table


CRC_EXTRA = _crc_extra()
_CRC_TABLES = _crc_tables()


@kernel
def checksum(data: Bytes, start: int, stop: int, seed: int) -> int:
    """MAVLink's checksum of data[start:stop] followed by the message's seed byte.

    Eight bytes at a time ("slicing by 8"): byte by byte each table look-up waits for the one before.
    """
    crc = 0xFFFF
    index = start
    while index + _SLICES <= stop:
        value = int(_CRC_TABLES[7, int(data[index]) ^ crc & 0xFF])
        value ^= int(_CRC_TABLES[6, int(data[index + 1]) ^ crc >> 8])
        for k in range(2, _SLICES):
            value ^= int(_CRC_TABLES[_SLICES - 1 - k, int(data[index + k])])
        crc = value
        index += _SLICES
    while index < stop:
        crc = crc >> 8 ^ int(_CRC_TABLES[0, (crc ^ int(data[index])) & 0xFF])
        index += 1
    return crc >> 8 ^ int(_CRC_TABLES[0, (crc ^ seed) & 0xFF])


@kernel
def scan(data: Bytes, table: Table, length: int) -> int:
    """Find every good frame in data[:length]: one row of `table` each; returns their number.

    The row behind the last holds in column START where a possibly unfinished frame begins that no good
    frame follows, or `length`. Unknown messages, bad checksums and stray bytes are passed over byte by byte.
    """
    count = 0
    position = 0
    unfinished = length
    while position < length and count + 1 < table.shape[0]:
        magic = data[position]
        if magic != MAGIC_V2 and magic != MAGIC_V1:
            position += 1
            continue
        header = HEADER_LENGTH_V2 if magic == MAGIC_V2 else HEADER_LENGTH_V1
        if position + header > length:
            unfinished = min(unfinished, position)
            position += 1
            continue
        signature = SIGNATURE_LENGTH if magic == MAGIC_V2 and data[position + 2] & FLAG_SIGNED else 0
        tail = position + header + int(data[position + 1])
        stop = tail + CHECKSUM_LENGTH + signature
        if stop > length:
            unfinished = min(unfinished, position)
            position += 1
            continue
        if magic == MAGIC_V2:
            message_id = (
                int(data[position + 7]) | int(data[position + 8]) << 8 | int(data[position + 9]) << 16
            )
            system, component = data[position + 5], data[position + 6]
        else:
            message_id = int(data[position + 5])
            system, component = data[position + 3], data[position + 4]
        seed = int(CRC_EXTRA[message_id]) if message_id < CRC_EXTRA.size else -1
        if seed < 0 or checksum(data, position + 1, tail, seed) != int(data[tail]) | int(data[tail + 1]) << 8:
            position += 1
            continue
        table[count, START] = position
        table[count, STOP] = stop
        table[count, MESSAGE_ID] = message_id
        table[count, SYSTEM] = system
        table[count, COMPONENT] = component
        table[count, PAYLOAD] = position + header
        table[count, PAYLOAD_LENGTH] = data[position + 1]
        count += 1
        position = stop
        unfinished = length  # what looked unfinished before was a false start: a whole frame stands behind it
    table[count, START] = unfinished
    return count


@entry_point(DATAGRAM, FRAME_TABLE, int)
def find_frames(data: Bytes, table: Table, length: int) -> int:
    """`scan`, for Python to call."""
    return int(scan(data, table, length))


@kernel
def write_frame(
    out: Bytes, at: int, payload: Bytes, message_id: int, sequence: int, system: int, component: int
) -> int:
    """Write one unsigned MAVLink 2 frame around an untruncated payload; returns the index behind it."""
    length = payload.size
    while length > 1 and payload[length - 1] == 0:
        length -= 1
    out[at] = MAGIC_V2
    out[at + 1] = length
    out[at + 2] = 0
    out[at + 3] = 0
    out[at + 4] = sequence
    out[at + 5] = system
    out[at + 6] = component
    out[at + 7] = message_id & 0xFF
    out[at + 8] = (message_id >> 8) & 0xFF
    out[at + 9] = (message_id >> 16) & 0xFF
    body = at + HEADER_LENGTH_V2
    for index in range(length):
        out[body + index] = payload[index]
    tail = body + length
    crc = checksum(out, at + 1, tail, int(CRC_EXTRA[message_id]))
    out[tail] = crc & 0xFF
    out[tail + 1] = crc >> 8
    return tail + CHECKSUM_LENGTH


@kernel
def read_payload(data: Bytes, row: NDArray[np.int32], payload: Bytes) -> None:
    """Copy a scanned frame's payload into `payload`, zeros where MAVLink 2 cut them off."""
    length = min(row[PAYLOAD_LENGTH], payload.size)
    start = row[PAYLOAD]
    for index in range(payload.size):
        payload[index] = data[start + index] if index < length else 0


class Frame(NamedTuple):
    """One checked frame. `payload` is as it came, trailing zeros possibly cut off (MAVLink 2)."""

    message_id: int
    system: int
    component: int
    payload: bytes
    raw: bytes
    """The whole frame as it stood on the wire, signature included."""

    @property
    def version(self) -> int:
        """MAVLink version of the frame, 1 or 2."""
        return 2 if self.raw[0] == MAGIC_V2 else 1

    @property
    def signed(self) -> bool:
        """Whether the frame carries a signature (which nobody has checked yet)."""
        return self.version == 2 and bool(self.raw[2] & FLAG_SIGNED)


class Split(NamedTuple):
    """What a piece of bytes held."""

    frames: list[Frame]
    junk: int
    """Number of bytes that belong to no good frame."""
    rest: bytes
    """A beginning that may become a frame with more bytes, shorter than a frame; a datagram has no more."""


_buffer = np.zeros(LARGEST_DATAGRAM, dtype=np.uint8)
_table = np.zeros((MOST_FRAMES + 1, TABLE_COLUMNS), dtype=np.int32)


def split(data: bytes) -> Split:
    """Find every good frame in `data`; unknown messages, bad checksums and stray bytes are junk."""
    if len(data) > LARGEST_DATAGRAM:
        raise ValueError(f"{len(data)} bytes at once, at most {LARGEST_DATAGRAM}")
    _buffer[: len(data)] = np.frombuffer(data, dtype=np.uint8)
    count = find_frames(_buffer, _table, len(data))
    unfinished = int(_table[count, START])
    frames = [frame_at(data, row) for row in _table[:count].tolist()]
    good = sum(len(frame.raw) for frame in frames)
    return Split(frames, unfinished - good, data[unfinished:])


def frame_at(data: bytes, row: list[int]) -> Frame:
    """The frame of one row of `scan`'s table."""
    payload = data[row[PAYLOAD] : row[PAYLOAD] + row[PAYLOAD_LENGTH]]
    return Frame(row[MESSAGE_ID], row[SYSTEM], row[COMPONENT], payload, data[row[START] : row[STOP]])


class StreamSplitter:
    """Frames from a byte stream (TCP), whatever pieces it arrives in."""

    def __init__(self) -> None:
        self._rest = b""
        self.junk = 0

    def receive(self, data: bytes) -> list[Frame]:
        """Add bytes from the stream, return the frames they complete."""
        found = split(self._rest + data)
        self._rest = found.rest
        self.junk += found.junk
        return found.frames


class Packer:
    """Builds MAVLink 2 frames of one sender (system, component), counting the sequence number."""

    def __init__(self, system: int, component: int) -> None:
        self.system = system
        self.component = component
        self.sequence = 0
        self._writer = common.MAVLink(None, srcSystem=system, srcComponent=component)

    def next_sequence(self) -> int:
        """The sequence number for the next frame."""
        sequence = self.sequence
        self.sequence = (sequence + 1) & 0xFF
        return sequence

    def pack(self, message: Any) -> bytes:
        """One MAVLink 2 frame of any pymavlink message."""
        self._writer.seq = self.next_sequence()
        return bytes(message.pack(self._writer))


_reader = common.MAVLink(None)


def decode(frame: Frame) -> Any:
    """Decode a checked frame into pymavlink's message object."""
    return _reader.decode(bytearray(frame.raw))
