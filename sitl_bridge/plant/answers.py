"""What the autopilot says on the HIL link: the answer to a tick, and everything else."""

from __future__ import annotations

from typing import Any, NamedTuple

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

# What `read_answer` found, as bits; the system of a foreign answer comes in the next byte.
ANSWERED, OTHERS, FOREIGN, JUNK = 1, 2, 4, 8
_FOREIGN_SHIFT = 8


@entry_point(
    DATAGRAM,
    FRAME_TABLE,
    Buffer(HIL_ACTUATOR_CONTROLS.dtype, (1,)),
    Buffer(np.uint8, (_PAYLOAD_SIZE,)),
    Buffer(np.float64, (ACTUATOR_CONTROLS,)),
    Buffer(np.int64, (3,)),
    int,
    int,
)
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

    header: number of frames, then time_usec and mode of the answer; controls (16,): the answer's.
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
        header[1] = record.time_usec
        header[2] = record.mode
    return found


class Answer(NamedTuple):
    """One HIL_ACTUATOR_CONTROLS."""

    time_usec: int
    controls: list[float]
    """16 controls, 0..1 for a rotor; possibly not finite."""
    armed: bool


class Received(NamedTuple):
    """What a datagram from the autopilot held."""

    answer: Answer | None
    others: list[Frame]
    foreign_system: int | None
    """System id of an answer that is not from this instance's autopilot."""
    junk: bool


class AnswerReader:
    """Reads datagrams from the autopilot of one instance."""

    def __init__(self, instance: int) -> None:
        self._system = vehicle_system(instance)
        self._data = np.zeros(LARGEST_DATAGRAM, dtype=np.uint8)
        self._table = np.zeros((MOST_FRAMES + 1, TABLE_COLUMNS), dtype=np.int32)
        record, payload = HIL_ACTUATOR_CONTROLS.record()
        self._controls = np.zeros(ACTUATOR_CONTROLS)
        self._header = np.zeros(3, dtype=np.int64)
        self._view = self._data.data
        self._read = read_answer.bind(self._data, self._table, record, payload, self._controls, self._header)

    def read(self, datagram: bytes) -> Received:
        """Everything in a datagram (at most 65536 bytes)."""
        length = len(datagram)
        self._view[:length] = datagram
        found = self._read(length, self._system)
        answer = None
        if found & ANSWERED:
            _, time_usec, mode = self._header.tolist()
            answer = Answer(time_usec, self._controls.tolist(), bool(mode & MODE_FLAG_ARMED))
        others: list[Frame] = []
        if found & OTHERS:
            rows = self._table[: self._header[0]].tolist()
            others = [frame_at(datagram, row) for row in rows if row[MESSAGE_ID] != _ANSWER_ID]
        foreign = found >> _FOREIGN_SHIFT if found & FOREIGN else None
        return Received(answer, others, foreign, bool(found & JUNK))
