"""A whole tick on the estimate in one compiled call: datagram in, estimator, control step, answer out.

What `truth_tick` is on truth: most ticks of a flight; `EstimateFeedback` and `HilSession` do the others in
parts (a fix of GPS, the tracker, a look at the estimate's health).
"""

from __future__ import annotations

from typing import Any

from controller.estimator import intake
from controller.estimator import step as estimator
from controller.estimator.step import ESTIMATOR_BUFFERS
from controller.hil import answers, ticks
from controller.hil.answers import WRITE_BUFFERS
from controller.hil.ticks import LOAD_TRUTH, READ_BUFFERS, TICK, VEHICLE_TRUTH, plant_seconds
from controller.law import control_step as step
from controller.law.allocation import MOST_ROTORS
from controller.law.control_step import LAW_BUFFERS
from controller.law.state import Array
from sitl_bridge.compiled import entry_point
from sitl_bridge.frames import MICROSECONDS_PER_SECOND
from sitl_bridge.mavlink.framing import Bytes

_read_tick = ticks.read_tick.python
_give = intake.give.python
_estimate = estimator.tick.python
_note_command = estimator.command.python
_control_step = step.control_step.python
_write_answer = answers.write_answer.python


@entry_point(
    *READ_BUFFERS, *ESTIMATOR_BUFFERS, *LAW_BUFFERS, *WRITE_BUFFERS, int, int, int, float, int, float
)
def answer_estimate(
    inboxes: Any,
    payloads: Bytes,
    filters: Any,
    given: Any,
    estimate: Array,
    rotor_speed: Array,
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
    first_time_usec: int,
    rate_hz: float,
) -> int:
    """Answer the inbox's data[:length] into the outbox; returns the answer's length, 0 for what is no plain
    tick.

    Arguments as for the parts: `read_tick`, `intake.give`, the estimator's `tick` and `command`,
    `control_step`, `write_answer`; the estimator's time counts from `first_time_usec`. A plain tick is later
    than `last_time_usec` and before `until_s`, and has nothing for the estimator but HIL_SENSOR.
    """
    inbox = inboxes[0]
    found = _read_tick(inboxes, payloads, length)
    time_usec, sensed = inbox.header[1], inbox.sensed
    if found & ~(VEHICLE_TRUTH | LOAD_TRUTH) != TICK or sensed[0].has_begun:
        return 0
    if time_usec <= last_time_usec or plant_seconds(time_usec) >= until_s:
        return 0
    _give(sensed, given)
    ticks_since = int((time_usec - first_time_usec) * rate_hz / MICROSECONDS_PER_SECOND + 0.5)
    given[0].time = ticks_since / rate_hz
    _estimate(filters, given, estimate)
    given[0].has_imu = given[0].has_magnetometer = given[0].has_altitude = False
    controls = outboxes[0].controls
    _control_step(designs, allocations, paths, memories, works, estimate, controls)
    for i in range(MOST_ROTORS):
        rotor_speed[i] = controls[i] * allocations[0].largest_speed[i]
    _note_command(filters, rotor_speed)
    return int(_write_answer(outboxes, answer_payload, time_usec, 1, sequence))
