"""A whole tick on the plant's truth in one compiled call: datagram in, control step, answer out.

Each call from Python costs more than the control law, so this is what most ticks of a flight on truth take.
Whatever is out of the ordinary (the first tick, a repeated one, other messages beside it) is left to
`HilSession`, which does the same in parts.
"""

from __future__ import annotations

from typing import Any

from controller.hil import answers, ticks
from controller.hil.answers import CONTROLS, WRITE_BUFFERS
from controller.hil.ticks import GPS, LOAD_TRUTH, READ_BUFFERS, TICK, VEHICLE_TRUTH
from controller.law import control_step as step
from controller.law.control_step import LAW_BUFFERS
from controller.law.state import Array
from sitl_bridge.compiled import entry_point
from sitl_bridge.mavlink.framing import Bytes

_read_tick = ticks.read_tick.python
_control_step = step.control_step.python
_write_answer = answers.write_answer.python
_PLAIN = TICK | VEHICLE_TRUTH | LOAD_TRUTH


@entry_point(*READ_BUFFERS, *LAW_BUFFERS, CONTROLS, *WRITE_BUFFERS, int, int, int, int, int)
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
    return int(_write_answer(controls, answer, answer_payload, out, header[1], 1, sequence, system))
