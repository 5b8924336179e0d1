"""The start: attitude from the mean specific force and magnetic field, position from GPS.

At rest there is time to average. In flight there is none: one sample of each sensor starts the filter, with
honest doubt, and GPS says later where it is.
"""

from __future__ import annotations

import math
from typing import Any

from controller.estimator.correct.receiver_wander import begin_wander
from controller.estimator.correct.update import set_part
from controller.estimator.records import (
    ATTITUDE,
    BARO_OFFSET,
    ERROR_SIZE,
    FLYING,
    GYRO_BIAS,
    LOAD,
    LOAD_ON_CABLE,
    LOAD_ON_GROUND,
    LOAD_VELOCITY,
    NOMINAL_SIZE,
    POSITION,
    SENSOR_COUNT,
    STANDING,
    VELOCITY,
    X_ATTITUDE,
    X_BARO_OFFSET,
    X_GYRO_BIAS,
    X_LOAD,
    X_LOAD_VELOCITY,
    X_POSITION,
    X_RATES,
    X_VELOCITY,
    Filter,
)
from sitl_bridge.compiled import kernel

IN_FLIGHT_TILT_STD = 0.15
"""rad: in flight the specific force is up only on average."""
IN_FLIGHT_SPEED_STD = 5.0  # m/s
UNKNOWN_PLACE_STD = 1e3  # m


@kernel
def _sane(vector: Any) -> bool:
    """Three numbers, and none of them absurd."""
    return bool(abs(vector[0]) < 1e6 and abs(vector[1]) < 1e6 and abs(vector[2]) < 1e6)


@kernel
def align(f: Filter, given: Any) -> None:
    """Gather samples; when there are enough, set the state and start the filter.

    At rest, the specific force is exactly up and the gyroscope shows its bias; a GPS fix says where. In
    flight the specific force is up on average, and the load hangs somewhere below.
    """
    p, m, x = f.p, f.m, f.x
    if given.has_imu and _sane(given.accelerometer) and _sane(given.gyroscope):
        m.align_count += 1
        for axis in range(3):
            m.align_sum[axis] += given.accelerometer[axis]
            m.align_sum[3 + axis] += given.gyroscope[axis]
    if given.has_magnetometer and _sane(given.magnetometer):
        m.align_magnetometer += 1
        for axis in range(3):
            m.align_sum[6 + axis] += given.magnetometer[axis]
    if given.has_gps and _sane(given.gps_position) and _sane(given.gps_velocity):
        m.align_gps = True
        for axis in range(3):
            x[X_POSITION + axis] = given.gps_position[axis]
            x[X_VELOCITY + axis] = given.gps_velocity[axis] if m.in_flight else 0.0
        m.next_clone = given.gps_time
        while m.next_clone < given.time + 0.5 * p.period:
            m.next_clone += p.clone_interval
    m.time = given.time
    enough = m.in_flight or (m.align_count >= p.align_samples and m.align_gps)
    if not enough or m.align_count < 1 or m.align_magnetometer < 1:
        return
    if not given.has_altitude or not abs(given.altitude) < 1e6:
        return
    for sensor in range(SENSOR_COUNT):
        m.last_used[sensor] = m.time
    count = float(m.align_count)
    a, b, c = m.align_sum[0], m.align_sum[1], m.align_sum[2]
    roll = math.atan2(b, c)
    pitch = math.atan2(-a, math.sqrt(b * b + c * c))
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    level = cr * m.align_sum[7] - sr * m.align_sum[8]
    ahead = cp * m.align_sum[6] + sp * (sr * m.align_sum[7] + cr * m.align_sum[8])
    yaw = math.atan2(p.field[1], p.field[0]) - math.atan2(level, ahead)
    sr, cr = math.sin(0.5 * roll), math.cos(0.5 * roll)
    sp, cp = math.sin(0.5 * pitch), math.cos(0.5 * pitch)
    sy, cy = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    for i in range(X_ATTITUDE, NOMINAL_SIZE):
        x[i] = 0.0
    x[X_ATTITUDE] = cr * cp * cy + sr * sp * sy
    x[X_ATTITUDE + 1] = sr * cp * cy - cr * sp * sy
    x[X_ATTITUDE + 2] = cr * sp * cy + sr * cp * sy
    x[X_ATTITUDE + 3] = cr * cp * sy - sr * sp * cy
    x[X_BARO_OFFSET] = given.altitude - x[X_POSITION + 2]
    for i in range(ERROR_SIZE):
        for j in range(ERROR_SIZE):
            f.P[i, j] = 0.0
        f.P[i, i] = p.initial_std[i] * p.initial_std[i]
    begin_wander(f, m.align_gps)
    if p.gps_wander_std[2] > 0.0:
        x[X_BARO_OFFSET] = p.home_altitude
    for axis in range(3):
        x[X_LOAD + axis] = p.initial_load[axis]
        mean = m.align_sum[3 + axis] / count
        if m.in_flight:
            x[X_RATES + axis] = mean
        else:
            x[X_GYRO_BIAS + axis] = mean
            f.P[GYRO_BIAS + axis, GYRO_BIAS + axis] = p.sensor_std[1] * p.sensor_std[1] / count
    if m.in_flight:
        start_hanging(f, 0.3, 1.0)
        f.P[ATTITUDE, ATTITUDE] = IN_FLIGHT_TILT_STD**2
        f.P[ATTITUDE + 1, ATTITUDE + 1] = IN_FLIGHT_TILT_STD**2
        if not m.align_gps:
            if p.gps_wander_std[2] == 0.0:
                x[X_BARO_OFFSET] = 0.0
                set_part(f, BARO_OFFSET, 1, UNKNOWN_PLACE_STD)
            set_part(f, POSITION, 3, UNKNOWN_PLACE_STD)
            set_part(f, VELOCITY, 3, IN_FLIGHT_SPEED_STD)
            m.next_clone = m.time
        m.vehicle_mode = FLYING
    else:
        m.vehicle_mode = STANDING
        m.grounded = p.starts_on_ground
        m.load_mode = LOAD_ON_GROUND if p.starts_on_ground else LOAD_ON_CABLE


@kernel
def start_hanging(f: Filter, spread: float, speed: float) -> None:
    """Put the load at rest below the vehicle; spread: as a part of the cable's length, speed: m/s."""
    p, x = f.p, f.x
    length = p.rest_length + p.load_mass * p.gravity / p.stiffness
    for axis in range(3):
        x[X_LOAD + axis] = -length if axis == 2 else 0.0
        x[X_LOAD_VELOCITY + axis] = 0.0
    set_part(f, LOAD, 3, spread * length)
    set_part(f, LOAD_VELOCITY, 3, speed)
