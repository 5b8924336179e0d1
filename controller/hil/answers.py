"""The autopilot's answer to a tick: HIL_ACTUATOR_CONTROLS; compiled."""

from __future__ import annotations

from typing import Any

import numpy as np

from sitl_bridge.compiled import Buffer, entry_point
from sitl_bridge.ids import ACTUATOR_CONTROLS, COMPONENT_AUTOPILOT, vehicle_system
from sitl_bridge.mavlink.framing import Bytes, Packer, write_frame
from sitl_bridge.mavlink.hil import FLAG_LOCKSTEP, HIL_ACTUATOR_CONTROLS, MODE_FLAG_ARMED

_ANSWER_ID = HIL_ACTUATOR_CONTROLS.message_id
_PAYLOAD_SIZE = HIL_ACTUATOR_CONTROLS.dtype.itemsize
ANSWER_SIZE = 128  # a frame of 81 bytes of payload, with room


CONTROLS = Buffer(np.float64, (ACTUATOR_CONTROLS,))
WRITE_BUFFERS = (
    Buffer(HIL_ACTUATOR_CONTROLS.dtype, (1,)),
    Buffer(np.uint8, (_PAYLOAD_SIZE,)),
    Buffer(np.uint8, (ANSWER_SIZE,)),
)
"""The other array arguments of `write_answer`; `AnswerWriter.buffers` has them."""


@entry_point(CONTROLS, *WRITE_BUFFERS, int, int, int, int)
def write_answer(
    controls: Any,
    records: Any,
    payload: Bytes,
    out: Bytes,
    time_usec: int,
    armed: int,
    sequence: int,
    system: int,
) -> int:
    """Write the answer to a tick, with controls (16,) of 0..1 when armed; returns its length."""
    record = records[0]
    record.time_usec = time_usec
    record.flags = FLAG_LOCKSTEP
    record.mode = MODE_FLAG_ARMED if armed else 0
    for i in range(ACTUATOR_CONTROLS):
        record.controls[i] = controls[i] if armed else 0.0
    return int(write_frame(out, 0, payload, _ANSWER_ID, sequence, system, COMPONENT_AUTOPILOT))


class AnswerWriter:
    """Builds answers of one instance; `controls` (16,) is what the next one carries."""

    def __init__(self, instance: int, packer: Packer) -> None:
        self.controls = np.zeros(ACTUATOR_CONTROLS)
        self._system = vehicle_system(instance)
        self._packer = packer
        record, payload = HIL_ACTUATOR_CONTROLS.record()
        out = np.zeros(ANSWER_SIZE, dtype=np.uint8)
        self.buffers = (record, payload, out)
        """The arrays of `write_answer` beside the controls."""
        self.view = out.data
        """Where an answer is written."""
        self._write = write_answer.bind(self.controls, *self.buffers)

    def answer(self, time_usec: int, armed: bool) -> bytes:
        """The frame that answers the tick of `time_usec`."""
        length = self._write(time_usec, armed, self._packer.next_sequence(), self._system)
        return bytes(self.view[:length])
