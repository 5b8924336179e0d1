"""A whole tick on the plant's truth in one compiled call: datagram in, control step, answer out.

Each call from Python costs more than the control law, so this is what most ticks of a flight on truth take.
Whatever is out of the ordinary (the first tick, a repeated one, other messages beside it) is left to
`HilSession`, which does the same in parts.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from controller import step
from controller.allocation import ALLOCATION, MOST_ROTORS
from controller.hil import answers, ticks
from controller.hil.answers import ANSWER_SIZE
from controller.hil.ticks import GPS, INCOMING, LOAD_TRUTH, SENSED, TICK, VEHICLE_TRUTH
from controller.law import DESIGN, MEMORY, WORK
from controller.reference import PATH
from controller.state import STATE_SIZE, Array
from sitl_bridge.compiled import Buffer, entry_point
from sitl_bridge.mavlink.framing import DATAGRAM, FRAME_TABLE, Bytes
from sitl_bridge.mavlink.hil import HIL_ACTUATOR_CONTROLS

_read_tick = ticks.read_tick.python
_control_step = step.control_step.python
_write_answer = answers.write_answer.python
_PLAIN = TICK | VEHICLE_TRUTH | LOAD_TRUTH


@entry_point(
    DATAGRAM,
    FRAME_TABLE,
    Buffer(INCOMING, (1,)),
    Buffer(np.uint8, (INCOMING.itemsize,)),
    Buffer(np.float64, (STATE_SIZE,)),
    Buffer(SENSED, (1,)),
    Buffer(np.int64, (2,)),
    Buffer(DESIGN, (1,)),
    Buffer(ALLOCATION, (1,)),
    Buffer(PATH, (1,)),
    Buffer(MEMORY, (1,)),
    Buffer(WORK, (1,)),
    Buffer(np.float64, (MOST_ROTORS,)),
    Buffer(HIL_ACTUATOR_CONTROLS.dtype, (1,)),
    Buffer(np.uint8, (HIL_ACTUATOR_CONTROLS.dtype.itemsize,)),
    Buffer(np.uint8, (ANSWER_SIZE,)),
    int,
    int,
    int,
    int,
    int,
)
def answer_truth(
    data: Bytes,
    table: Any,
    records: Any,
    payloads: Bytes,
    estimate: Array,
    sensed: Any,
    header: Any,
    designs: Any,
    allocations: Any,
    paths: Any,
    memories: Any,
    works: Any,
    controls: Array,
    answer: Any,
    answer_payload: Bytes,
    out: Bytes,
    system: int,
    load_system: int,
    length: int,
    last_time_usec: int,
    sequence: int,
) -> int:
    """Answer data[:length] into `out`; returns the answer's length, 0 for what is no plain tick.

    Arguments as for the parts: `read_tick`, `control_step`, `write_answer`. A plain tick is later than
    `last_time_usec`, with truth of both bodies, and nothing beside but HIL_GPS and HIL_STATE_QUATERNION.
    """
    found = _read_tick(data, table, records, payloads, estimate, sensed, header, length, system, load_system)
    if found & ~GPS != _PLAIN or header[1] <= last_time_usec:
        return 0
    _control_step(designs, allocations, paths, memories, works, estimate, controls)
    return int(_write_answer(answer, answer_payload, controls, out, header[1], 1, sequence, system))
