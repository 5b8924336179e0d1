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
from sitl_bridge.plant.physics.record import WORLD
from sitl_bridge.plant.physics.state import Array
from sitl_bridge.plant.sensors import instruments
from sitl_bridge.plant.sensors import truth as sensing
from sitl_bridge.plant.wire import answers, messages
from sitl_bridge.plant.wire.answers import ANSWERED, ARMED, READ_BUFFERS
from sitl_bridge.plant.wire.messages import STATE, WRITE_BUFFERS, is_due

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
    Buffer(WORLD, (1,)),
    # the log's rows
    Buffer(np.float64, (CHUNK_ROWS, WIDTH)),
    *WRITE_BUFFERS,
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
def fly_whole_tick(
    inboxes: Any,
    answer_payload: Bytes,
    worlds: Any,
    log: Array,
    outboxes: Any,
    payloads: Bytes,
    length: int,
    time_usec: int,
    next_time_usec: int,
    first_force: int,
    first_wind: int,
    sensor_tick: int,
    row: int,
    wanted: int,
    time_s: float,
) -> int:
    """Fly the tick of `time_usec` if the inbox's data[:length] is its armed answer and no more.

    Returns the length of the next tick's datagram in the outbox, or 0 where nothing was done. With length
    NO_DATAGRAM the tick is flown in any case.

    worlds: the record of the world; other arguments as for the parts: `answers.read_answer`, `rows.fill_row`
    (row < 0: there is no log), `dynamics.advance`, `sensors.instruments.read` (the next tick is `sensor_tick`
    of the sensors), `messages.write_tick`. The tables of held forces and winds have to last beyond the tick.
    """
    world = worlds[0]
    parameters, x, inner, truth = world.parameters, world.state, world.inner, world.truth
    rotor_speed, work, plan = world.rotor_speed, world.work, world.schedule
    force, wind = world.force.now, world.wind.now
    if length != NO_DATAGRAM:
        found = _read_answer(inboxes, answer_payload, length)
        if found != ANSWERED | ARMED or inboxes[0].header[1] != time_usec:
            return 0
        _set_rotors(parameters, inboxes[0].controls, world.speed_share, rotor_speed)
    if row >= 0:
        _fill_row(parameters, x, inner, rotor_speed, force, log, row, time_s)
    _advance(
        parameters,
        x,
        inner,
        rotor_speed,
        world.force.table,
        world.wind.table,
        work,
        first_force,
        first_wind,
        plan.force_hold,
        plan.wind_hold,
        plan.steps,
        plan.step,
    )
    for i in range(6):
        force[i] = world.force.table[(first_force + plan.steps) // plan.force_hold, i]
        wind[i] = world.wind.table[(first_wind + plan.steps) // plan.wind_hold, i]
    _measure(
        parameters,
        x,
        inner,
        force,
        wind,
        work,
        world.magnetic_field,
        world.reactions,
        truth,
        0,
        plan.home_altitude,
    )
    _read_sensors(truth, world.instruments, sensor_tick)
    if is_due(outboxes[0].state_pace, next_time_usec):
        wanted |= STATE
    reading = world.instruments[0].reading
    return int(_write_tick(outboxes, payloads, reading, truth, x, wind, next_time_usec, wanted))
