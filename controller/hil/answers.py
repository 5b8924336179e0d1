"""The autopilot's answer to a tick: HIL_ACTUATOR_CONTROLS; compiled."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.compiled import Buffer, entry_point
from sitl_bridge.ids import ACTUATOR_CONTROLS, COMPONENT_AUTOPILOT, vehicle_system
from sitl_bridge.mavlink.framing import Bytes, Packer, write_frame
from sitl_bridge.mavlink.hil import FLAG_LOCKSTEP, HIL_ACTUATOR_CONTROLS, MODE_FLAG_ARMED

_ANSWER_ID = HIL_ACTUATOR_CONTROLS.message_id
_PAYLOAD_SIZE = HIL_ACTUATOR_CONTROLS.dtype.itemsize
ANSWER_SIZE = 128  # a frame of 81 bytes of payload, with room


OUTBOX = np.dtype(
    [
        ("system", "i8"),  # system id of the autopilot
        ("controls", "f8", ACTUATOR_CONTROLS),  # that the next answer carries, 0..1
        ("answer", HIL_ACTUATOR_CONTROLS.dtype, (1,)),
        ("datagram", "u1", ANSWER_SIZE),
    ],
    align=True,
)
"""The autopilot's answer, and the datagram with its frame."""
_ANSWER_AT: int = OUTBOX.fields["answer"][1]  # type: ignore[index]  # the type has fields

WRITE_BUFFERS = (Buffer(OUTBOX, (1,)), Buffer(np.uint8, (_PAYLOAD_SIZE,)))
"""The array arguments of `write_answer`; `AnswerWriter.buffers` has them."""


@entry_point(*WRITE_BUFFERS, int, int, int)
def write_answer(outboxes: Any, payload: Bytes, time_usec: int, armed: int, sequence: int) -> int:
    """Write the answer to a tick into the outbox, with its controls when armed; returns the length.

    payload: the bytes of the outbox's answer, the same memory.
    """
    outbox = outboxes[0]
    record, controls, out, system = outbox.answer[0], outbox.controls, outbox.datagram, outbox.system
    record.time_usec = time_usec
    record.flags = FLAG_LOCKSTEP
    record.mode = MODE_FLAG_ARMED if armed else 0
    for i in range(ACTUATOR_CONTROLS):
        record.controls[i] = controls[i] if armed else 0.0
    return int(write_frame(out, 0, payload, _ANSWER_ID, sequence, system, COMPONENT_AUTOPILOT))


class AnswerWriter:
    """Builds answers of one instance; `controls` (16,) is what the next one carries."""

    def __init__(self, instance: int, packer: Packer) -> None:
        outbox = np.zeros(1, dtype=OUTBOX)
        fields = outbox[0]
        fields["system"] = vehicle_system(instance)
        self.controls: NDArray[np.float64] = fields["controls"]
        self._packer = packer
        self.buffers = (outbox, outbox.view(np.uint8)[_ANSWER_AT : _ANSWER_AT + _PAYLOAD_SIZE])
        """The arrays of `write_answer`."""
        self.view = fields["datagram"].data
        """Where an answer is written."""
        self._write = write_answer.bind(*self.buffers)

    def answer(self, time_usec: int, armed: bool) -> bytes:
        """The frame that answers the tick of `time_usec`."""
        length = self._write(time_usec, armed, self._packer.next_sequence())
        return bytes(self.view[:length])
