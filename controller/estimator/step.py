"""The compiled entry points: one tick of the filter, and changes of what it flies."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from controller.estimator.alignment import align, start_hanging
from controller.estimator.contact_modes import leave_ground, lose_track, release, stand, watch
from controller.estimator.correct.delayed import OUTAGE, gps, remember, tracker
from controller.estimator.correct.pseudo_measurements import load_at_rest, on_ground, rest
from controller.estimator.correct.receiver_wander import fade_wander
from controller.estimator.correct.sensors import accelerometer, barometer, gyroscope, magnetometer
from controller.estimator.dropped_load import drop
from controller.estimator.late_commands import LEAST_CHANGE, watch_delay
from controller.estimator.predict.process import predict
from controller.estimator.records import (
    ALIGNING,
    BODY_RATES_OUT,
    CLONE_LOAD,
    CLONE_MOTION,
    EULER_OUT,
    FILTER,
    FLYING,
    GPS_POSITION,
    GPS_VELOCITY,
    INPUT,
    LOAD_DROPPED,
    LOAD_ON_CABLE,
    LOAD_ON_GROUND,
    LOAD_OUT,
    LOAD_RELEASED,
    LOAD_VELOCITY_OUT,
    MOST_ROTORS,
    OUTPUT_SIZE,
    POSITION_OUT,
    STANDING,
    VELOCITY_OUT,
    X_ATTITUDE,
    X_LOAD,
    X_LOAD_VELOCITY,
    X_POSITION,
    X_RATES,
    X_VELOCITY,
    Array,
    Filter,
)
from sitl_bridge.compiled import Buffer, entry_point, kernel
from sitl_bridge.mavlink.hil import ROTORS_STOP_AFTER

MOST_MISSED_TICKS = 50
"""Ticks without a measurement that the model bridges; in longer silence more may happen than it knows."""
MOST_BRIDGED_TICKS = 1000
"""For so many it goes on all the same: the rotors stand by then, and all fall alike."""
BLIND_CLONE_TICKS = 5
"""As long as no fix has said when fixes are taken: near enough to any of them."""
SLIP_SPEED = 0.3
"""m/s (of the velocity: m/s²), at which a slip fades at most"""
SLIP_TIME = 1.0
"""s, its time constant when it is small"""


@kernel
def report(f: Filter, out: Array) -> None:
    """Write the estimate (18,) in the order of eq. 31, without the slip.

    The slip is what GPS corrected at a stroke after an outage. It fades at a speed that a law can follow:
    a step of metres in its feedback would throw the vehicle over.
    """
    x, slip = f.x, f.m.slip
    for part in range(2):
        size = math.sqrt(slip[3 * part] ** 2 + slip[3 * part + 1] ** 2 + slip[3 * part + 2] ** 2)
        if size > 0.0:
            faded = 1.0 - min(SLIP_SPEED / size, 1.0 / SLIP_TIME) * f.p.period
            for i in range(3 * part, 3 * part + 3):
                slip[i] *= faded
    for i in range(3):
        out[POSITION_OUT + i] = x[X_POSITION + i] - slip[i]
        out[LOAD_OUT + i] = x[X_POSITION + i] + x[X_LOAD + i] - slip[i]
        out[VELOCITY_OUT + i] = x[X_VELOCITY + i] - slip[3 + i]
        out[LOAD_VELOCITY_OUT + i] = x[X_VELOCITY + i] + x[X_LOAD_VELOCITY + i] - slip[3 + i]
        out[BODY_RATES_OUT + i] = x[X_RATES + i]
    w, i, j, k = x[X_ATTITUDE], x[X_ATTITUDE + 1], x[X_ATTITUDE + 2], x[X_ATTITUDE + 3]
    out[EULER_OUT] = math.atan2(2.0 * (w * i + j * k), 1.0 - 2.0 * (i * i + j * j))
    out[EULER_OUT + 1] = math.asin(max(-1.0, min(1.0, 2.0 * (w * j - k * i))))
    out[EULER_OUT + 2] = math.atan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k))


ESTIMATOR_BUFFERS = (
    Buffer(FILTER, (1,)),
    Buffer(INPUT, (1,)),
    Buffer(np.float64, (OUTPUT_SIZE,)),
    Buffer(np.float64, (MOST_ROTORS,)),
)
"""State, input and estimate, the arguments of `tick`, and the speeds that `command` takes."""


@entry_point(*ESTIMATOR_BUFFERS[:3])
def tick(record: Any, measurements: Any, out: Array) -> int:
    """Predict to the tick's time, take in its measurements, and write the estimate `out` (18,), eq. 31.

    Returns the vehicle's mode.
    """
    f, given = record[0], measurements[0]
    p, m = f.p, f.m
    if m.vehicle_mode == ALIGNING:
        align(f, given)
        report(f, out)
        return int(m.vehicle_mode)
    ticks = int((given.time - m.time) / p.period + 0.5)
    for missed in range(min(ticks, MOST_BRIDGED_TICKS)):
        if missed > 0:
            fly_on(f, missed * p.period)
        predict(f)
        fade_wander(f)
        if m.time > m.next_clone - 0.5 * p.period:
            remember(f, CLONE_MOTION)
            m.next_clone += p.clone_interval if m.align_gps else BLIND_CLONE_TICKS * p.period
        if p.tracker_interval > 0.0 and m.time > m.next_load_clone - 0.5 * p.period:
            remember(f, CLONE_LOAD)
            m.next_load_clone += p.tracker_interval
    m.time = given.time
    if ticks > MOST_MISSED_TICKS:
        lose_track(f, (ticks - MOST_MISSED_TICKS) * p.period)
    silence = m.time - max(m.last_used[GPS_POSITION], m.last_used[GPS_VELOCITY])
    m.adrift = m.vehicle_mode == FLYING and silence > OUTAGE
    if given.has_imu:
        gyroscope(f, given.gyroscope)
        watch_delay(f, given.gyroscope, ticks, LEAST_CHANGE)
        accelerometer(f, given.accelerometer)
        watch(f, given.accelerometer)
    if given.has_magnetometer:
        magnetometer(f, given.magnetometer)
    if given.has_altitude:
        barometer(f, given.altitude)
    if given.has_gps:
        gps(f, given)
    if given.has_tracker:
        tracker(f, given)
    if m.vehicle_mode == STANDING:
        rest(f)
        if m.grounded and p.has_ground:
            on_ground(f)
    if m.load_mode in (LOAD_ON_GROUND, LOAD_DROPPED):
        load_at_rest(f)
    report(f, out)
    return int(m.vehicle_mode)


@kernel
def fly_on(f: Filter, silence: float) -> None:
    """A tick that did not come, and got no answer: the plant goes on with the last one, and stops at length.

    silence: s, since the last tick that was answered.
    """
    m = f.m
    last, row = (m.command_count - 1) % m.commands.shape[0], m.command_count % m.commands.shape[0]
    for i in range(MOST_ROTORS):
        m.commands[row, i] = m.commands[last, i] if silence < ROTORS_STOP_AFTER else 0.0
    m.command_count += 1


@entry_point(Buffer(FILTER, (1,)), Buffer(np.float64, (MOST_ROTORS,)))
def command(record: Any, rotor_speed: Array) -> int:
    """Note the rotor speeds (rad/s) that are commanded from this tick on."""
    m = record[0].m
    row = m.command_count % m.commands.shape[0]
    for i in range(MOST_ROTORS):
        m.commands[row, i] = rotor_speed[i]
    m.command_count += 1
    return int(m.command_count)


@entry_point(Buffer(FILTER, (1,)), int, int)
def change(record: Any, vehicle_mode: int, load_mode: int) -> int:
    """Change what holds the vehicle and what the load does; returns the vehicle's mode."""
    f = record[0]
    m = f.m
    if load_mode != m.load_mode:
        if load_mode == LOAD_RELEASED:
            release(f)
        elif load_mode == LOAD_DROPPED:
            drop(f)
        elif load_mode == LOAD_ON_CABLE and m.load_mode == LOAD_RELEASED:
            start_hanging(f, 0.3, 1.0)
        m.load_mode = load_mode
    if vehicle_mode == FLYING and m.vehicle_mode == STANDING:
        leave_ground(f)
    elif vehicle_mode == STANDING and m.vehicle_mode == FLYING:
        stand(f)
    m.slack_time = 0.0
    m.pull_time = 0.0
    for axis in range(3):
        m.pull[axis] = 0.0
    return int(m.vehicle_mode)
