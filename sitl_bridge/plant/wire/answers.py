"""What the autopilot says on the HIL link: the answer to a tick, and everything else."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sitl_bridge.compiled import Buffer, entry_point
from sitl_bridge.ids import ACTUATOR_CONTROLS, vehicle_system
from sitl_bridge.mavlink.framing import (
    DATAGRAM,
    FRAME_TABLE,
    LARGEST_DATAGRAM,
    MESSAGE_ID,
    MOST_FRAMES,
    START,
    STOP,
    SYSTEM,
    TABLE_COLUMNS,
    Bytes,
    Frame,
    frame_at,
    read_payload,
    scan,
)
from sitl_bridge.mavlink.hil import HIL_ACTUATOR_CONTROLS, MODE_FLAG_ARMED

_ANSWER_ID = HIL_ACTUATOR_CONTROLS.message_id
_PAYLOAD_SIZE = HIL_ACTUATOR_CONTROLS.dtype.itemsize

# What `read_answer` found, as bits; the system of a foreign answer comes in the byte above them.
ANSWERED, ARMED, NOT_FINITE, OTHERS, FOREIGN, JUNK = 1, 2, 4, 8, 16, 32
_FOREIGN_SHIFT = 8


READ_BUFFERS = (
    DATAGRAM,
    FRAME_TABLE,
    Buffer(HIL_ACTUATOR_CONTROLS.dtype, (1,)),
    Buffer(np.uint8, (_PAYLOAD_SIZE,)),
    Buffer(np.float64, (ACTUATOR_CONTROLS,)),
    Buffer(np.int64, (2,)),
)
"""The array arguments of `read_answer`; `AnswerReader.arrays` has them."""


@entry_point(*READ_BUFFERS, int, int)
def read_answer(
    data: Bytes,
    table: Any,
    records: Any,
    payload: Bytes,
    controls: Any,
    header: Any,
    length: int,
    system: int,
) -> int:
    """Find the last HIL_ACTUATOR_CONTROLS of `system` in data[:length]; returns bits of what was found.

    header: number of frames, time_usec of the answer; controls (16,): the answer's.
    """
    count = scan(data, table, length)
    header[0] = count
    found = 0
    good = 0
    for i in range(count):
        good += table[i, STOP] - table[i, START]
        if table[i, MESSAGE_ID] != _ANSWER_ID:
            found |= OTHERS
        elif table[i, SYSTEM] != system:
            found |= FOREIGN | table[i, SYSTEM] << _FOREIGN_SHIFT
        else:
            read_payload(data, table[i], payload)
            found |= ANSWERED
    if good < length:
        found |= JUNK
    if found & ANSWERED:
        record = records[0]
        for i in range(ACTUATOR_CONTROLS):
            controls[i] = record.controls[i]
            if not math.isfinite(controls[i]):
                found |= NOT_FINITE
        header[1] = record.time_usec
        if record.mode & MODE_FLAG_ARMED:
            found |= ARMED
    return found


class AnswerReader:
    """Reads datagrams from the autopilot of one instance."""

    def __init__(self, instance: int) -> None:
        self.controls = np.zeros(ACTUATOR_CONTROLS)
        """Of the latest answer, 0..1 for a rotor; possibly not finite."""
        self.system = vehicle_system(instance)
        """System id of the autopilot."""
        data = np.zeros(LARGEST_DATAGRAM, dtype=np.uint8)
        self._table = np.zeros((MOST_FRAMES + 1, TABLE_COLUMNS), dtype=np.int32)
        header = np.zeros(2, dtype=np.int64)
        record, payload = HIL_ACTUATOR_CONTROLS.record()
        self.view = data.data
        """Where a datagram is put to be read."""
        self._header = header.data  # numbers come faster out of a memoryview
        self.arrays = (data, self._table, record, payload, self.controls, header)
        """The array arguments of `read_answer`."""
        self._read = read_answer.bind(*self.arrays)

    @property
    def time_usec(self) -> int:
        """Of the tick that the latest answer is for."""
        return self._header[1]

    def read(self, datagram: bytes) -> int:
        """Look through a datagram (at most 65536 bytes); returns bits of what it holds."""
        length = len(datagram)
        self.view[:length] = datagram
        found: int = self._read(length, self.system)
        return found

    def others(self, datagram: bytes) -> list[Frame]:
        """The frames of the datagram just read that are no answers."""
        rows = self._table[: self._header[0]].tolist()
        return [frame_at(datagram, row) for row in rows if row[MESSAGE_ID] != _ANSWER_ID]


def foreign_system(found: int) -> int:
    """System id of an answer that is not from this instance's autopilot."""
    return found >> _FOREIGN_SHIFT
