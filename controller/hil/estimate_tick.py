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
from controller.hil.answers import CONTROLS, WRITE_BUFFERS
from controller.hil.ticks import LOAD_TRUTH, READ_BUFFERS, TICK, VEHICLE_TRUTH
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
    *READ_BUFFERS,
    *ESTIMATOR_BUFFERS,
    *LAW_BUFFERS,
    CONTROLS,
    *WRITE_BUFFERS,
    int,
    int,
    int,
    int,
    int,
    int,
    float,
)
def answer_estimate(
    data: Bytes,
    table: Any,
    records: Any,
    payloads: Bytes,
    truth: Array,
    sensed: Any,
    header: Any,
    filters: Any,
    given: Any,
    estimate: Array,
    rotor_speed: Array,
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
    first_time_usec: int,
    rate_hz: float,
) -> int:
    """Answer data[:length] into `out`; returns the answer's length, 0 for what is no plain tick.

    Arguments as for the parts: `read_tick`, `intake.give`, the estimator's `tick` and `command`,
    `control_step`, `write_answer`; the estimator's time counts from `first_time_usec`. A plain tick is later
    than `last_time_usec`, and has nothing for the estimator but HIL_SENSOR.
    """
    found = _read_tick(data, table, records, payloads, truth, sensed, header, length, system, load_system)
    if found & ~(VEHICLE_TRUTH | LOAD_TRUTH) != TICK or header[1] <= last_time_usec or sensed[0].has_begun:
        return 0
    _give(sensed, given)
    ticks_since = int((header[1] - first_time_usec) * rate_hz / MICROSECONDS_PER_SECOND + 0.5)
    given[0].time = ticks_since / rate_hz
    _estimate(filters, given, estimate)
    given[0].has_imu = given[0].has_magnetometer = given[0].has_altitude = False
    _control_step(designs, allocations, paths, memories, works, estimate, controls)
    for i in range(MOST_ROTORS):
        rotor_speed[i] = controls[i] * allocations[0].largest_speed[i]
    _note_command(filters, rotor_speed)
    return int(_write_answer(controls, answer, answer_payload, out, header[1], 1, sequence, system))
