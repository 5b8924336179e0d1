"""Telemetry logs: frames behind the time they crossed the link, as ground stations record them.

What crosses the HIL link at every tick can be recorded at a limited rate: all of one tick in so many. All
else is recorded always, and so is each answer with another mode than the one before.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from sitl_bridge.compiled import Buffer, entry_point, kernel
from sitl_bridge.log_amount import Logs
from sitl_bridge.mavlink.framing import (
    DATAGRAM,
    FRAME_TABLE,
    LARGEST_DATAGRAM,
    MESSAGE_ID,
    MOST_FRAMES,
    PAYLOAD,
    PAYLOAD_LENGTH,
    START,
    STOP,
    TABLE_COLUMNS,
    Bytes,
    scan,
)
from sitl_bridge.mavlink.hil import HIL_ACTUATOR_CONTROLS, HIL_SENSOR, HIL_STATE_QUATERNION, ODOMETRY

FILE_NAME = "link.tlog"
TIMESTAMP_SIZE = 8
_OUT_SIZE = LARGEST_DATAGRAM + TIMESTAMP_SIZE * MOST_FRAMES


RECORDED_HZ: dict[Logs, float | None] = {"usual": 10.0, "all": None}
"""How often what crosses the link at every tick is recorded; None: always."""
_CONTROLS, _SENSOR = HIL_ACTUATOR_CONTROLS.message_id, HIL_SENSOR.message_id
_STATE, _ODOMETRY = HIL_STATE_QUATERNION.message_id, ODOMETRY.message_id
_MODE = dict(HIL_ACTUATOR_CONTROLS.dtype.fields or {})["mode"][1]
"""Offset in the payload"""
_INTERVAL, _SLOT, _TICK, _LAST_MODE = range(4)
_LIMITER = Buffer(np.int64, (4,))
"""Interval, us (0: no limit); number of the interval that it is now; time of its tick, us; last mode"""


@kernel
def _byte(data: Bytes, table: Any, row: int, at: int) -> int:
    """Byte `at` of a frame's payload, whose zeros at the end may have been cut off."""
    return int(data[table[row, PAYLOAD] + at]) if at < table[row, PAYLOAD_LENGTH] else 0


@kernel
def _is_kept(data: Bytes, table: Any, row: int, limiter: Any) -> bool:
    """Whether a frame is recorded. Those that are limited begin with their tick's time."""
    message = table[row, MESSAGE_ID]
    limited = message in (_CONTROLS, _SENSOR, _STATE, _ODOMETRY)
    if limiter[_INTERVAL] == 0 or not limited:
        return True
    time = 0
    for at in range(8):
        time |= _byte(data, table, row, at) << (8 * at)
    slot = time // limiter[_INTERVAL]
    if slot > limiter[_SLOT] or slot < limiter[_SLOT] - 1:  # or the simulation has begun afresh
        limiter[_SLOT], limiter[_TICK] = slot, time
    if message == _CONTROLS:
        mode = _byte(data, table, row, _MODE)
        if mode != limiter[_LAST_MODE]:
            limiter[_LAST_MODE] = mode
            return True
    return bool(time == limiter[_TICK])


@entry_point(DATAGRAM, FRAME_TABLE, Buffer(np.uint8, (_OUT_SIZE,)), _LIMITER, int, int)
def stamp_frames(data: Bytes, table: Any, out: Bytes, limiter: Any, length: int, time_usec: int) -> int:
    """Copy good frames of data[:length] to `out` behind the time (us, big-endian); returns the length."""
    at = 0
    for i in range(scan(data, table, length)):
        if not _is_kept(data, table, i, limiter):
            continue
        for byte in range(TIMESTAMP_SIZE):
            out[at + byte] = (time_usec >> (8 * (TIMESTAMP_SIZE - 1 - byte))) & 0xFF
        at += TIMESTAMP_SIZE
        for index in range(table[i, START], table[i, STOP]):
            out[at] = data[index]
            at += 1
    return at


class TlogWriter:
    """Writes a .tlog file that pymavlink's and ground stations' tools read."""

    def __init__(self, path: Path, rate_hz: float | None = None) -> None:
        """rate_hz: how often what crosses the link at every tick is recorded; None: always."""
        self._file: BinaryIO = path.open("wb", buffering=1 << 16)
        self._data = np.zeros(LARGEST_DATAGRAM, dtype=np.uint8)
        self._out = np.zeros(_OUT_SIZE, dtype=np.uint8)
        self._data_view, self._out_view = self._data.data, self._out.data
        table = np.zeros((MOST_FRAMES + 1, TABLE_COLUMNS), dtype=np.int32)
        limiter = np.array([0 if rate_hz is None else round(1e6 / rate_hz), -1, -1, -1], dtype=np.int64)
        self._stamp = stamp_frames.bind(self._data, table, self._out, limiter)

    def write(self, datagram: bytes, unix_time_s: float) -> None:
        """Record the frames of one datagram."""
        self._data_view[: len(datagram)] = datagram
        length = self._stamp(len(datagram), int(unix_time_s * 1e6))
        self._file.write(self._out_view[:length])

    def close(self) -> None:
        """Write out what is buffered."""
        self._file.close()
