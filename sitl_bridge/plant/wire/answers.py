"""What the autopilot says on the HIL link: the answer to a tick, and everything else."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.compiled import Buffer, entry_point
from sitl_bridge.ids import ACTUATOR_CONTROLS, vehicle_system
from sitl_bridge.mavlink.framing import (
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


INBOX = np.dtype(
    [
        ("header", "i8", 2),  # number of frames, time_usec of the answer
        ("system", "i8"),  # system id of the autopilot
        ("controls", "f8", ACTUATOR_CONTROLS),  # the answer's
        ("answer", HIL_ACTUATOR_CONTROLS.dtype, (1,)),
        ("frames", np.int32, (MOST_FRAMES + 1, TABLE_COLUMNS)),  # where each frame stands, see `scan`
        ("data", "u1", LARGEST_DATAGRAM),
    ],
    align=True,
)
"""A datagram from the autopilot, and what was found in it."""
_ANSWER_AT: int = INBOX.fields["answer"][1]  # type: ignore[index]  # the type has fields

READ_BUFFERS = (Buffer(INBOX, (1,)), Buffer(np.uint8, (_PAYLOAD_SIZE,)))
"""The array arguments of `read_answer`; `AnswerReader.arrays` has them."""


@entry_point(*READ_BUFFERS, int)
def read_answer(inboxes: Any, payload: Bytes, length: int) -> int:
    """Find the last HIL_ACTUATOR_CONTROLS of the inbox's system in its data[:length]; returns bits of what
    was found.

    payload: the bytes of the inbox's answer, the same memory.
    """
    inbox = inboxes[0]
    data, table, header, controls, system = (
        inbox.data,
        inbox.frames,
        inbox.header,
        inbox.controls,
        inbox.system,
    )
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
        record = inbox.answer[0]
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
        inbox = np.zeros(1, dtype=INBOX)
        fields = inbox[0]
        self.controls: NDArray[np.float64] = fields["controls"]
        """Of the latest answer, 0..1 for a rotor; possibly not finite."""
        self.system = vehicle_system(instance)
        """System id of the autopilot."""
        fields["system"] = self.system
        self._table: NDArray[np.int32] = fields["frames"]
        self.view = fields["data"].data
        """Where a datagram is put to be read."""
        self._header = fields["header"].data  # numbers come faster out of a memoryview
        payload = inbox.view(np.uint8)[_ANSWER_AT : _ANSWER_AT + _PAYLOAD_SIZE]
        self.arrays = (inbox, payload)
        """The array arguments of `read_answer`."""
        self._read = read_answer.bind(*self.arrays)

    @property
    def time_usec(self) -> int:
        """Of the tick that the latest answer is for."""
        return int(self._header[1])

    def read(self, datagram: bytes) -> int:
        """Look through a datagram (at most 65536 bytes); returns bits of what it holds."""
        length = len(datagram)
        self.view[:length] = datagram
        found: int = self._read(length)
        return found

    def others(self, datagram: bytes) -> list[Frame]:
        """The frames of the datagram just read that are no answers."""
        rows = self._table[: self._header[0]].tolist()
        return [frame_at(datagram, row) for row in rows if row[MESSAGE_ID] != _ANSWER_ID]


def foreign_system(found: int) -> int:
    """System id of an answer that is not from this instance's autopilot."""
    return found >> _FOREIGN_SHIFT
