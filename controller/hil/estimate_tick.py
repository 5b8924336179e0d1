"""A whole tick on the estimate in one compiled call: datagram in, estimator, control step, answer out.

What `truth_tick` is on truth: most ticks of a flight; `EstimateFeedback` and `HilSession` do the others in
parts (a fix of GPS, the tracker, a look at the estimate's health).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from controller import step
from controller.allocation import ALLOCATION, MOST_ROTORS
from controller.estimator import intake
from controller.estimator import step as estimator
from controller.estimator.layout import FILTER, INPUT, OUTPUT_SIZE
from controller.hil import answers, ticks
from controller.hil.answers import ANSWER_SIZE
from controller.hil.ticks import INCOMING, LOAD_TRUTH, SENSED, TICK, VEHICLE_TRUTH
from controller.law import DESIGN, MEMORY, WORK
from controller.reference import PATH
from controller.state import STATE_SIZE, Array
from sitl_bridge.compiled import Buffer, entry_point
from sitl_bridge.frames import MICROSECONDS_PER_SECOND
from sitl_bridge.mavlink.framing import DATAGRAM, FRAME_TABLE, Bytes
from sitl_bridge.mavlink.hil import HIL_ACTUATOR_CONTROLS

_read_tick = ticks.read_tick.python
_give = intake.give.python
_estimate = estimator.tick.python
_note_command = estimator.command.python
_control_step = step.control_step.python
_write_answer = answers.write_answer.python


@entry_point(
    DATAGRAM,
    FRAME_TABLE,
    Buffer(INCOMING, (1,)),
    Buffer(np.uint8, (INCOMING.itemsize,)),
    Buffer(np.float64, (STATE_SIZE,)),
    Buffer(SENSED, (1,)),
    Buffer(np.int64, (2,)),
    Buffer(FILTER, (1,)),
    Buffer(INPUT, (1,)),
    Buffer(np.float64, (OUTPUT_SIZE,)),
    Buffer(np.float64, (MOST_ROTORS,)),
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
    return int(_write_answer(answer, answer_payload, controls, out, header[1], 1, sequence, system))
