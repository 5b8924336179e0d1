"""Telemetry logs: every frame behind the time it crossed the link, as ground stations record them."""

from __future__ import annotations

from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from sitl_bridge.compiled import Buffer, entry_point
from sitl_bridge.mavlink.framing import (
    DATAGRAM,
    FRAME_TABLE,
    LARGEST_DATAGRAM,
    MOST_FRAMES,
    START,
    STOP,
    TABLE_COLUMNS,
    Bytes,
    scan,
)

FILE_NAME = "link.tlog"
TIMESTAMP_SIZE = 8
_OUT_SIZE = LARGEST_DATAGRAM + TIMESTAMP_SIZE * MOST_FRAMES


@entry_point(DATAGRAM, FRAME_TABLE, Buffer(np.uint8, (_OUT_SIZE,)), int, int)
def stamp_frames(data: Bytes, table: Any, out: Bytes, length: int, time_usec: int) -> int:
    """Copy each good frame of data[:length] to `out` behind the time (us, big-endian); returns the length."""
    at = 0
    for i in range(scan(data, table, length)):
        for byte in range(TIMESTAMP_SIZE):
            out[at + byte] = (time_usec >> (8 * (TIMESTAMP_SIZE - 1 - byte))) & 0xFF
        at += TIMESTAMP_SIZE
        for index in range(table[i, START], table[i, STOP]):
            out[at] = data[index]
            at += 1
    return at


class TlogWriter:
    """Writes a .tlog file that pymavlink's and ground stations' tools read."""

    def __init__(self, path: Path) -> None:
        self._file: BinaryIO = path.open("wb", buffering=1 << 16)
        self._data = np.zeros(LARGEST_DATAGRAM, dtype=np.uint8)
        self._out = np.zeros(_OUT_SIZE, dtype=np.uint8)
        self._data_view, self._out_view = self._data.data, self._out.data
        table = np.zeros((MOST_FRAMES + 1, TABLE_COLUMNS), dtype=np.int32)
        self._stamp = stamp_frames.bind(self._data, table, self._out)

    def write(self, datagram: bytes, unix_time_s: float) -> None:
        """Record the frames of one datagram."""
        self._data_view[: len(datagram)] = datagram
        length = self._stamp(len(datagram), int(unix_time_s * 1e6))
        self._file.write(self._out_view[:length])

    def close(self) -> None:
        """Write out what is buffered."""
        self._file.close()
