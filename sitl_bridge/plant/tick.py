"""A whole tick in one compiled call: the autopilot's answer in, rotors, a row of the log, the steps, the
sensors, the next tick's frames out.

Each call from Python costs more than the physics of a tick, so most ticks of a flight go this way: all on
which no stage is due, see `stages`. The others are done by the same parts, called singly; both give the same
states, rows and bytes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sitl_bridge.compiled import Buffer, entry_point
from sitl_bridge.mavlink.framing import Bytes
from sitl_bridge.plant.log import rows
from sitl_bridge.plant.log.rows import CHUNK_ROWS, WIDTH
from sitl_bridge.plant.physics import dynamics
from sitl_bridge.plant.physics.dynamics import TABLE_ROWS, WORK_ROWS
from sitl_bridge.plant.physics.parameters import PARAMETERS
from sitl_bridge.plant.physics.state import INNER_SIZE, MOST_ROTORS, REACTIONS_SIZE, STATE_SIZE, Array
from sitl_bridge.plant.physics.world import SCHEDULE
from sitl_bridge.plant.sensors import instruments
from sitl_bridge.plant.sensors import truth as sensing
from sitl_bridge.plant.sensors.instruments import CHANNELS, MEASUREMENT, ROWS
from sitl_bridge.plant.wire import answers, messages
from sitl_bridge.plant.wire.answers import ANSWERED, ARMED, READ_BUFFERS
from sitl_bridge.plant.wire.messages import DATAGRAM_SIZE, OUTGOING, STATE, is_due

NO_DATAGRAM = -1
"""Length of the datagram for a tick that is flown on with the rotor speeds as they are."""

_read_answer = answers.read_answer.python
_set_rotors = dynamics.set_rotors.python
_fill_row = rows.fill_row.python
_advance = dynamics.advance.python
_measure = sensing.measure.python
_read_sensors = instruments.read.python
_write_tick = messages.write_tick.python


@entry_point(
    *READ_BUFFERS,
    # the world, see `World.arrays`
    Buffer(PARAMETERS, (1,)),
    Buffer(SCHEDULE, (1,)),
    Buffer(np.float64, (STATE_SIZE,)),
    Buffer(np.float64, (INNER_SIZE,)),
    Buffer(np.float64, (MOST_ROTORS,)),
    Buffer(np.float64, (MOST_ROTORS,)),
    Buffer(np.float64, (TABLE_ROWS, 6)),
    Buffer(np.float64, (6,)),
    Buffer(np.float64, (TABLE_ROWS, 6)),
    Buffer(np.float64, (6,)),
    Buffer(np.float64, (WORK_ROWS, STATE_SIZE)),
    Buffer(np.float64, (3,)),
    Buffer(np.float64, (REACTIONS_SIZE,)),
    Buffer(MEASUREMENT, (1,)),
    Buffer(np.float64, (ROWS, CHANNELS)),
    Buffer(np.float64, (ROWS, CHANNELS)),
    Buffer(np.float64, (4, CHANNELS)),
    Buffer(np.int64, (2, CHANNELS)),
    Buffer(MEASUREMENT, (1,)),
    # the log's rows
    Buffer(np.float64, (CHUNK_ROWS, WIDTH)),
    # what `messages.write_tick` takes besides
    Buffer(OUTGOING, (1,)),
    Buffer(np.uint8, (OUTGOING.itemsize,)),
    Buffer(np.float64, (5,)),
    Buffer(np.int64, (4,)),
    Buffer(np.float64, (2,)),
    Buffer(np.uint8, (DATAGRAM_SIZE,)),
    int,
    int,
    int,
    int,
    int,
    int,
    int,
    int,
    int,
    float,
)
def exchange(
    data: Bytes,
    frames: Any,
    answer: Any,
    answer_payload: Bytes,
    controls: Array,
    header: Any,
    record: Any,
    schedules: Any,
    x: Array,
    inner: Array,
    speed_share: Array,
    rotor_speed: Array,
    forces: Array,
    force: Array,
    winds: Array,
    wind: Array,
    work: Array,
    magnetic_field: Array,
    reactions: Array,
    truth: Any,
    errors: Array,
    garbage: Array,
    figures: Array,
    timing: Any,
    reading: Any,
    log: Array,
    outgoing: Any,
    payloads: Bytes,
    geodesy: Array,
    counters: Any,
    state_pace: Array,
    out: Bytes,
    length: int,
    system: int,
    time_usec: int,
    next_time_usec: int,
    first_force: int,
    first_wind: int,
    sensor_tick: int,
    row: int,
    wanted: int,
    time_s: float,
) -> int:
    """Fly the tick of `time_usec` if data[:length] is its armed answer and no more; returns the length of the
    next tick's datagram in `out`, or 0 where nothing was done. With length NO_DATAGRAM it is flown in any
    case.

    Arguments as for the parts: `answers.read_answer`, `dynamics.set_rotors` and `advance`, `rows.fill_row`
    (row < 0: there is no log), `sensing.measure`, `sensors.instruments.read` (the next tick is `sensor_tick`
    of the sensors), `messages.write_tick`. force and wind become those that act at the tick's end; the tables
    have to last beyond it.
    """
    if length != NO_DATAGRAM:
        found = _read_answer(data, frames, answer, answer_payload, controls, header, length, system)
        if found != ANSWERED | ARMED or header[1] != time_usec:
            return 0
        _set_rotors(record, controls, speed_share, rotor_speed)
    plan = schedules[0]
    if row >= 0:
        _fill_row(record, x, inner, rotor_speed, force, log, row, time_s)
    _advance(
        record,
        x,
        inner,
        rotor_speed,
        forces,
        winds,
        work,
        first_force,
        first_wind,
        plan.force_hold,
        plan.wind_hold,
        plan.steps,
        plan.step,
    )
    for i in range(6):
        force[i] = forces[(first_force + plan.steps) // plan.force_hold, i]
        wind[i] = winds[(first_wind + plan.steps) // plan.wind_hold, i]
    _measure(record, x, inner, force, wind, work, magnetic_field, reactions, truth, 0, plan.home_altitude)
    _read_sensors(truth, errors, garbage, figures, timing, reading, sensor_tick)
    if is_due(state_pace, next_time_usec):
        wanted |= STATE
    return int(
        _write_tick(
            outgoing, payloads, reading, truth, x, wind, geodesy, counters, out, next_time_usec, wanted
        )
    )
