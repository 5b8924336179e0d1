"""A whole tick on the plant's truth in one compiled call: datagram in, control step, answer out.

Each call from Python costs more than the control law, so this is what most ticks of a flight on truth take.
Whatever is out of the ordinary (the first tick, a repeated one, other messages beside it) is left to
`HilSession`, which does the same in parts.
"""

from __future__ import annotations

from typing import Any

from controller.hil import answers, ticks
from controller.hil.answers import WRITE_BUFFERS
from controller.hil.ticks import GPS, LOAD_TRUTH, READ_BUFFERS, TICK, VEHICLE_TRUTH, plant_seconds
from controller.law import control_step as step
from controller.law.control_step import LAW_BUFFERS
from sitl_bridge.compiled import entry_point
from sitl_bridge.mavlink.framing import Bytes

_read_tick = ticks.read_tick.python
_control_step = step.control_step.python
_write_answer = answers.write_answer.python
_PLAIN = TICK | VEHICLE_TRUTH | LOAD_TRUTH


@entry_point(*READ_BUFFERS, *LAW_BUFFERS, *WRITE_BUFFERS, int, int, int, float)
def answer_truth(
    inboxes: Any,
    payloads: Bytes,
    designs: Any,
    allocations: Any,
    paths: Any,
    memories: Any,
    works: Any,
    outboxes: Any,
    answer_payload: Bytes,
    length: int,
    last_time_usec: int,
    sequence: int,
    until_s: float,
) -> int:
    """Answer the inbox's data[:length] into the outbox; returns the answer's length, 0 for what is no plain
    tick.

    Arguments as for the parts: `read_tick`, `control_step`, `write_answer`. A plain tick is later than
    `last_time_usec` and before `until_s`, with truth of both bodies, and nothing beside but HIL_GPS and
    HIL_STATE_QUATERNION.
    """
    inbox = inboxes[0]
    found = _read_tick(inboxes, payloads, length)
    time_usec = inbox.header[1]
    if found & ~GPS != _PLAIN or time_usec <= last_time_usec or plant_seconds(time_usec) >= until_s:
        return 0
    _control_step(designs, allocations, paths, memories, works, inbox.estimate, outboxes[0].controls)
    return int(_write_answer(outboxes, answer_payload, time_usec, 1, sequence))
