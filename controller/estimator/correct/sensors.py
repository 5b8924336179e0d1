"""What each sensor says about the state: innovations, measurement rows, gates."""

from __future__ import annotations

import math
from typing import Any

from controller.estimator.correct.gating import GARBAGE, accept, record_nis, row_ratio
from controller.estimator.correct.live_samples import note_sample
from controller.estimator.correct.sudden_offset import note_step_of_force, note_step_of_rate, note_usual_rate
from controller.estimator.correct.update import ROW, begin, fuse, inject
from controller.estimator.predict.forces import cable, drag_rate
from controller.estimator.predict.rotation import matrix
from controller.estimator.records import (
    ACCEL_BIAS,
    ACCELEROMETER,
    ATTITUDE,
    BARO_OFFSET,
    BAROMETER,
    FLYING,
    FORCE,
    GYRO_BIAS,
    GYROSCOPE,
    LOAD,
    LOAD_VELOCITY,
    MAG_BIAS,
    MAGNETOMETER,
    POSITION,
    RATES,
    VELOCITY,
    X_ACCEL_BIAS,
    X_BARO_OFFSET,
    X_FORCE,
    X_GYRO_BIAS,
    X_LOAD,
    X_MAG_BIAS,
    X_POSITION,
    X_RATES,
    X_VELOCITY,
    Array,
    Filter,
)
from sitl_bridge.compiled import kernel


@kernel
def saturated(f: Filter, specific_force: float) -> bool:
    """Whether an axis of the accelerometer is at its limit, where it says nothing but "much"."""
    return bool(abs(specific_force) >= 0.999 * f.p.accelerometer_range)


@kernel
def accelerometer(f: Filter, measured: Any) -> None:
    """Specific force, m/s², body: (thrust z_b + R'F_cable) / m_v + R'force + bias; at rest R'g + bias.

    Standing, it shows which way is up. Flying, it shows the cable, and so the load.
    """
    p, m = f.p, f.m
    if note_sample(f, ACCELEROMETER, measured):
        m.rejected[ACCELEROMETER] += 1
        return
    noise = p.sensor_std[ACCELEROMETER] * p.sensor_std[ACCELEROMETER]
    if m.vehicle_mode == FLYING:
        noise += p.gust_std * p.gust_std
    begin(f)
    worst, squares, used = 0.0, 0.0, 0
    for axis in range(3):
        if saturated(f, measured[axis]):
            continue
        innovation = measured[axis] - _accelerometer_row(f, axis)
        worst = max(worst, row_ratio(f, ACCELEROMETER, axis, innovation, noise))
        used += 1
    if used < 3:
        m.rejected[ACCELEROMETER] += 1
    if not note_step_of_force(f) and not accept(f, ACCELEROMETER, worst):
        return
    taut = m.tension > 0.0 and not p.two_way and m.vehicle_mode == FLYING
    before = along_cable(f)
    for axis in range(3):
        if saturated(f, measured[axis]):
            continue
        innovation = measured[axis] - _accelerometer_row(f, axis)
        squares += fuse(f, innovation, noise)
    inject(f)
    record_nis(f, ACCELEROMETER, squares, used)
    if taut:
        allow_for_slack(f, before)


@kernel
def along_cable(f: Filter) -> float:
    """Variance of the load's distance, m²."""
    x, cov, total, square = f.x, f.P, 0.0, 1e-12
    for i in range(3):
        square += x[X_LOAD + i] ** 2
        for j in range(3):
            total += x[X_LOAD + i] * cov[LOAD + i, LOAD + j] * x[X_LOAD + j]
    return total / square


@kernel
def allow_for_slack(f: Filter, before: float) -> None:
    """A cable that was thought taut and is found slack is known to be no longer than that, and no more.

    before: the variance (m²) of its length before the measurement, which is what remains.
    """
    x, cov = f.x, f.P
    cable(f, f.vectors[0])
    widened = before - along_cable(f)
    if f.m.tension > 0.0 or widened <= 0.0:
        return
    square = x[X_LOAD] ** 2 + x[X_LOAD + 1] ** 2 + x[X_LOAD + 2] ** 2
    for i in range(3):
        for j in range(3):
            cov[LOAD + i, LOAD + j] += widened * x[X_LOAD + i] * x[X_LOAD + j] / square


@kernel
def _accelerometer_row(f: Filter, axis: int) -> float:
    """Write the row of one axis; returns the predicted specific force."""
    p, x, row, jacobian = f.p, f.x, f.vectors[ROW], f.vectors[0]
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = matrix(x)
    if axis == 0:
        a, b, c = r00, r10, r20
    elif axis == 1:
        a, b, c = r01, r11, r21
    else:
        a, b, c = r02, r12, r22
    if f.m.vehicle_mode == FLYING:
        fx, fy, fz = cable(f, jacobian)
        own = 1.0 / p.vehicle_mass
        vx, vy, vz = x[X_VELOCITY], x[X_VELOCITY + 1], x[X_VELOCITY + 2]
        brake = drag_rate(p.vehicle_drag, p.vehicle_mass, vx, vy, vz)
        wx = fx * own + x[X_FORCE] - brake * vx
        wy = fy * own + x[X_FORCE + 1] - brake * vy
        wz = fz * own + x[X_FORCE + 2] - brake * vz
        lift = f.m.thrust * own if axis == 2 else 0.0
        row[VELOCITY], row[VELOCITY + 1], row[VELOCITY + 2] = -brake * a, -brake * b, -brake * c
        row[FORCE], row[FORCE + 1], row[FORCE + 2] = a, b, c
        for j in range(3):
            row[LOAD + j] = own * (a * jacobian[j] + b * jacobian[3 + j] + c * jacobian[6 + j])
            row[LOAD_VELOCITY + j] = own * (a * jacobian[9 + j] + b * jacobian[12 + j] + c * jacobian[15 + j])
    else:
        wx, wy, wz, lift = 0.0, 0.0, p.gravity, 0.0
    # R'w turns with the attitude error as [R'w]x.
    bx = r00 * wx + r10 * wy + r20 * wz
    by = r01 * wx + r11 * wy + r21 * wz
    bz = r02 * wx + r12 * wy + r22 * wz
    if axis == 0:
        row[ATTITUDE + 1], row[ATTITUDE + 2] = -bz, by
    elif axis == 1:
        row[ATTITUDE], row[ATTITUDE + 2] = bz, -bx
    else:
        row[ATTITUDE], row[ATTITUDE + 1] = -by, bx
    row[ACCEL_BIAS + axis] = 1.0
    return float(lift + a * wx + b * wy + c * wz + x[X_ACCEL_BIAS + axis])


@kernel
def gyroscope(f: Filter, measured: Any) -> None:
    """Body rates plus bias, rad/s."""
    p, m, x = f.p, f.m, f.x
    limit = p.gyroscope_range * 0.999
    beyond = abs(measured[0]) >= limit or abs(measured[1]) >= limit or abs(measured[2]) >= limit
    if note_sample(f, GYROSCOPE, measured) or beyond:
        m.rejected[GYROSCOPE] += 1
        return
    noise = p.sensor_std[GYROSCOPE] * p.sensor_std[GYROSCOPE]
    note_usual_rate(f)
    begin(f)
    worst, squares = 0.0, 0.0
    for axis in range(3):
        innovation = measured[axis] - x[X_RATES + axis] - x[X_GYRO_BIAS + axis]
        f.vectors[ROW, RATES + axis], f.vectors[ROW, GYRO_BIAS + axis] = 1.0, 1.0
        worst = max(worst, row_ratio(f, GYROSCOPE, axis, innovation, noise))
    suspect_moments(f)
    # Rates that the known moments do not explain (a collision, a lost rotor) are real: the gate on them only
    # widens the rates, it does not refuse what the gyroscope sees for long.
    if not accept(f, GYROSCOPE, worst):
        if worst > 0.01 * GARBAGE:
            return
        note_step_of_rate(f)
        if m.rejected_in_row[GYROSCOPE] < 3:
            return
        for axis in range(3):
            f.P[RATES + axis, RATES + axis] += (SUSPECTED_RATES * f.p.sensor_std[GYROSCOPE]) ** 2
    for axis in range(3):
        f.vectors[ROW, RATES + axis], f.vectors[ROW, GYRO_BIAS + axis] = 1.0, 1.0
        squares += fuse(f, m.innovation[GYROSCOPE, axis], noise)
    inject(f)
    record_nis(f, GYROSCOPE, squares, 3)


MOMENT_BLEND = 0.02
MOMENT_LIMIT = 0.5
"""Of the running mean of gyroscope innovations (50 samples), in standard deviations: 5 of its own."""
SUSPECTED_RATES = 10.0
"""The gyroscope's standard deviations: how wrong the rates then may be."""


@kernel
def suspect_moments(f: Filter) -> None:
    """Rates that stay ahead of the model, or behind: a moment acts that the rotor commands do not explain.

    A rotor is weaker than it was, or a load pulls off the centre. The gyroscope then counts for more.
    """
    m, cov, half = f.m, f.P, 0.5 * f.p.period
    unknown = (SUSPECTED_RATES * f.p.sensor_std[GYROSCOPE]) ** 2
    for axis in range(3):
        m.turn_suspicion[axis] += MOMENT_BLEND * (m.normalised[GYROSCOPE, axis] - m.turn_suspicion[axis])
        if abs(m.turn_suspicion[axis]) > MOMENT_LIMIT:
            # What the moment gave the rates over the last tick, it gave the attitude half of, times the tick.
            rate, angle = RATES + axis, ATTITUDE + axis
            cov[rate, rate] += unknown
            cov[rate, angle] += half * unknown
            cov[angle, rate] += half * unknown
            cov[angle, angle] += half * half * unknown


@kernel
def magnetometer(f: Filter, measured: Any) -> None:
    """The heading in a field vector, body, any unit.

    Only the direction of its horizontal part is used: nearby iron then disturbs heading, never roll or pitch.
    A sample that repeats bit for bit is a stuck sensor.
    """
    p, m = f.p, f.m
    if note_sample(f, MAGNETOMETER, measured):
        m.rejected[MAGNETOMETER] += 1
        return
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = matrix(f.x)
    whole = math.sqrt(measured[0] ** 2 + measured[1] ** 2 + measured[2] ** 2)
    a = measured[0] - whole * f.x[X_MAG_BIAS]
    b = measured[1] - whole * f.x[X_MAG_BIAS + 1]
    x = r00 * a + r01 * b + r02 * measured[2]
    y = r10 * a + r11 * b + r12 * measured[2]
    fx, fy, fz = p.field[0], p.field[1], p.field[2]
    level = fx * fx + fy * fy
    innovation = -math.atan2(fx * y - fy * x, fx * x + fy * y)
    # A world rotation d turns the field's horizontal direction by d_z - f_z (f_x d_x + f_y d_y) / f_h².
    tilt = -fz / level
    noise = p.sensor_std[MAGNETOMETER] * p.sensor_std[MAGNETOMETER]
    begin(f)
    _magnetometer_row(f, tilt * fx, tilt * fy, r00, r10, r20, r01, r11, r21, r02, r12, r22)
    if not accept(f, MAGNETOMETER, row_ratio(f, MAGNETOMETER, 0, innovation, noise)):
        return
    _magnetometer_row(f, tilt * fx, tilt * fy, r00, r10, r20, r01, r11, r21, r02, r12, r22)
    squares = fuse(f, innovation, noise)
    inject(f)
    record_nis(f, MAGNETOMETER, squares, 1)


@kernel
def _magnetometer_row(
    f: Filter,
    tx: float,
    ty: float,
    r00: float,
    r10: float,
    r20: float,
    r01: float,
    r11: float,
    r21: float,
    r02: float,
    r12: float,
    r22: float,
) -> None:
    row = f.vectors[ROW]
    row[ATTITUDE] = tx * r00 + ty * r10 + r20
    row[ATTITUDE + 1] = tx * r01 + ty * r11 + r21
    row[ATTITUDE + 2] = tx * r02 + ty * r12 + r22
    # A lasting error e of the field, horizontal, turns what is measured of the heading by -(f x e) / f_h².
    fx, fy = f.p.field[0], f.p.field[1]
    level = fx * fx + fy * fy
    row[MAG_BIAS] = -(fx * r10 - fy * r00) / level
    row[MAG_BIAS + 1] = -(fx * r11 - fy * r01) / level


@kernel
def barometer(f: Filter, altitude: float) -> None:
    """Pressure altitude above home, m: height plus the barometer's offset."""
    p = f.p
    noise = p.sensor_std[BAROMETER] * p.sensor_std[BAROMETER]
    innovation = altitude - f.x[X_POSITION + 2] - f.x[X_BARO_OFFSET]
    begin(f)
    f.vectors[ROW, POSITION + 2], f.vectors[ROW, BARO_OFFSET] = 1.0, 1.0
    if not accept(f, BAROMETER, row_ratio(f, BAROMETER, 0, innovation, noise)):
        return
    f.vectors[ROW, POSITION + 2], f.vectors[ROW, BARO_OFFSET] = 1.0, 1.0
    squares = fuse(f, innovation, noise)
    inject(f)
    record_nis(f, BAROMETER, squares, 1)


@kernel
def measured_pull(f: Filter, measured: Any, out: Array) -> float:
    """The cable's force on the vehicle as the accelerometer alone has it, N, world; returns its size.

    out: (3,) written.
    """
    p, x = f.p, f.x
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = matrix(x)
    a = p.vehicle_mass * (measured[0] - x[X_ACCEL_BIAS])
    b = p.vehicle_mass * (measured[1] - x[X_ACCEL_BIAS + 1])
    c = p.vehicle_mass * (measured[2] - x[X_ACCEL_BIAS + 2]) - f.m.thrust
    vx, vy, vz = x[X_VELOCITY], x[X_VELOCITY + 1], x[X_VELOCITY + 2]
    brake = p.vehicle_mass * drag_rate(p.vehicle_drag, p.vehicle_mass, vx, vy, vz)
    out[0] = r00 * a + r01 * b + r02 * c + brake * vx
    out[1] = r10 * a + r11 * b + r12 * c + brake * vy
    out[2] = r20 * a + r21 * b + r22 * c + brake * vz
    return math.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
