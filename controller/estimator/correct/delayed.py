"""Measurements that arrive late, applied at the time they belong to: stochastic cloning.

At the instants at which a late measurement may have been taken, the filter remembers what it measures
(position and velocity for GPS, the load's place in body axes for the tracker) as extra states that move no
more but stay correlated with the rest. A late measurement corrects its instant, and through the correlation
the present: exactly what a filter without delay, but with hindsight, would do.
"""

from __future__ import annotations

from typing import Any

from controller.estimator.correct.cable_length import measure_cable
from controller.estimator.correct.gating import accept, gate_ratio, record_nis
from controller.estimator.correct.receiver_wander import WANDER, wanders
from controller.estimator.correct.update import (
    CORRECTION,
    begin,
    fuse_remembered,
    inject,
    remembered_variance,
)
from controller.estimator.predict.rotation import matrix
from controller.estimator.records import (
    ATTITUDE,
    BARO_OFFSET,
    CLONE_FREE,
    CLONE_LOAD,
    CLONE_MOTION,
    CLONE_ROWS,
    CLONE_SIZE,
    CLONE_WANDER,
    CLONES,
    ERROR_SIZE,
    FLYING,
    GPS_POSITION,
    GPS_VELOCITY,
    LOAD,
    POSITION,
    TRACKER,
    X_LOAD,
    X_POSITION,
    Filter,
)
from sitl_bridge.compiled import kernel


@kernel
def remember(f: Filter, kind: int) -> int:
    """Remember the present instant; returns its slot (the oldest one gives way)."""
    m, cov = f.m, f.P
    first = WANDER + 1 if m.clone_kind[WANDER] == CLONE_WANDER else 0
    slot = first
    for i in range(first, CLONES):
        if m.clone_kind[i] == CLONE_FREE:
            slot = i
            break
        if m.clone_time[i] < m.clone_time[slot]:
            slot = i
    base = slot * CLONE_ROWS
    for k in range(base, base + CLONE_ROWS):
        for j in range(CLONE_SIZE):
            f.Pzz[k, j] = 0.0
            f.Pzz[j, k] = 0.0
        for i in range(ERROR_SIZE):
            f.Pxz[i, k] = 0.0
        f.z[k] = 0.0
    m.clone_time[slot] = m.time
    m.clone_kind[slot] = kind
    m.clone_width = max(m.clone_width, base + CLONE_ROWS)
    if kind == CLONE_MOTION:
        for i in range(CLONE_ROWS):  # position and velocity lie side by side in both states
            f.z[base + i] = f.x[X_POSITION + i]
            for j in range(ERROR_SIZE):
                f.Pxz[j, base + i] = cov[POSITION + i, j]
        for i in range(CLONE_ROWS):
            for j in range(CLONE_SIZE):
                f.Pzz[base + i, j] = f.Pxz[POSITION + i, j]
                f.Pzz[j, base + i] = f.Pxz[POSITION + i, j]
        return slot
    row = f.vectors[0]
    for axis in range(3):
        f.z[base + axis] = load_row(f, axis)
        for j in range(ERROR_SIZE):
            total = 0.0
            for i in range(3):
                total += row[LOAD + i] * cov[LOAD + i, j] + row[ATTITUDE + i] * cov[ATTITUDE + i, j]
            f.Pxz[j, base + axis] = total
    for axis in range(3):
        load_row(f, axis)
        for k in range(CLONE_SIZE):
            total = 0.0
            for i in range(3):
                total += row[LOAD + i] * f.Pxz[LOAD + i, k] + row[ATTITUDE + i] * f.Pxz[ATTITUDE + i, k]
            f.Pzz[base + axis, k] = total
            f.Pzz[k, base + axis] = total
    return slot


@kernel
def load_row(f: Filter, axis: int) -> float:
    """The load's place along one body axis, m; its derivative goes into the first scratch vector."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = matrix(f.x)
    row = f.vectors[0]
    x, y, z = f.x[X_LOAD], f.x[X_LOAD + 1], f.x[X_LOAD + 2]
    bx = r00 * x + r10 * y + r20 * z
    by = r01 * x + r11 * y + r21 * z
    bz = r02 * x + r12 * y + r22 * z
    if axis == 0:
        row[LOAD], row[LOAD + 1], row[LOAD + 2] = r00, r10, r20
        row[ATTITUDE], row[ATTITUDE + 1], row[ATTITUDE + 2] = 0.0, -bz, by
        return float(bx)
    if axis == 1:
        row[LOAD], row[LOAD + 1], row[LOAD + 2] = r01, r11, r21
        row[ATTITUDE], row[ATTITUDE + 1], row[ATTITUDE + 2] = bz, 0.0, -bx
        return float(by)
    row[LOAD], row[LOAD + 1], row[LOAD + 2] = r02, r12, r22
    row[ATTITUDE], row[ATTITUDE + 1], row[ATTITUDE + 2] = -by, bx, 0.0
    return float(bz)


@kernel
def recall(f: Filter, kind: int, time: float) -> int:
    """The remembered instant nearest to a time, at most two ticks off; the present if it is that; else -1."""
    m = f.m
    if time >= m.time - 0.5 * f.p.period:
        return remember(f, kind)
    best, distance = -1, 2.0 * f.p.period
    for i in range(CLONES):
        if m.clone_kind[i] == kind and abs(m.clone_time[i] - time) <= distance:
            best, distance = i, abs(m.clone_time[i] - time)
    return best


@kernel
def forget(f: Filter, kind: int, time: float) -> None:
    """Free the instants of a kind up to a time: measurements come in order."""
    m = f.m
    for i in range(CLONES):
        if m.clone_kind[i] == kind and m.clone_time[i] <= time + 0.5 * f.p.period:
            m.clone_kind[i] = CLONE_FREE
            for k in range(i * CLONE_ROWS, (i + 1) * CLONE_ROWS):
                for j in range(ERROR_SIZE):
                    f.Pxz[j, k] = 0.0
                for j in range(CLONE_SIZE):
                    f.Pzz[k, j] = 0.0
                    f.Pzz[j, k] = 0.0
    m.clone_width = 0
    for i in range(CLONES):
        if m.clone_kind[i] != CLONE_FREE:
            m.clone_width = (i + 1) * CLONE_ROWS


@kernel
def gps(f: Filter, given: Any) -> None:
    """GPS position and velocity, world ENU, at the time they belong to.

    The first fix after a silence may belong to an instant that was not remembered; then it only sets the
    time of the next ones.
    """
    m = f.m
    slot = recall(f, CLONE_MOTION, given.gps_time)
    repeats = _repeats_itself(f, given)
    m.next_clone = given.gps_time
    while m.next_clone < m.time + 0.5 * f.p.period:
        m.next_clone += f.p.clone_interval
    if slot < 0:
        return
    if repeats:
        m.rejected[GPS_POSITION] += 1
        m.rejected[GPS_VELOCITY] += 1
        forget(f, CLONE_MOTION, given.gps_time)
        return
    m.align_gps = True
    m.adrift = False
    base = slot * CLONE_ROWS
    if m.time - max(m.last_used[GPS_POSITION], m.last_used[GPS_VELOCITY]) > OUTAGE:
        m.slip_until = m.time + SLIPPING
    age = given.gps_time - m.clone_time[slot]
    for half in range(2):
        sensor = GPS_POSITION if half == 0 else GPS_VELOCITY
        worst, squares = 0.0, 0.0
        begin(f)
        for axis in range(3):
            k = base + 3 * half + axis
            also = CLONE_ROWS * WANDER + axis if wanders(f) and half == 0 else k
            if half == 0:
                innovation = given.gps_position[axis] - f.z[k] - age * f.z[k + 3]
                std = given.gps_position_std[axis]
                if also != k:
                    innovation -= f.z[also]
            else:
                innovation = given.gps_velocity[axis] - f.z[k]
                std = given.gps_velocity_std[axis]
            variance = remembered_variance(f, k, also) + std * std
            worst = max(worst, gate_ratio(f, sensor, axis, innovation, variance))
        if not accept(f, sensor, worst):
            continue
        if half == 0:
            _suspect_barometer(f, m.normalised[sensor, 2])
        for axis in range(3):
            std = given.gps_position_std[axis] if half == 0 else given.gps_velocity_std[axis]
            k = base + 3 * half + axis
            also = CLONE_ROWS * WANDER + axis if wanders(f) and half == 0 else k
            squares += fuse_remembered(f, k, also, m.innovation[sensor, axis], std * std)
        _slip(f)
        inject(f)
        record_nis(f, sensor, squares, 3)
    forget(f, CLONE_MOTION, given.gps_time)


STALE_FIXES = 3
"""So many fixes that are the same to the last digit, in flight, and the receiver is stuck."""
LIVELY_VELOCITY = 0.02
"""m/s: a receiver with less noise may say the same twice, in centimetres and centimetres per second."""


@kernel
def _repeats_itself(f: Filter, given: Any) -> bool:
    """Compare a fix with the one before; whether the receiver is stuck."""
    m, same = f.m, True
    for axis in range(3):
        same = same and given.gps_position[axis] == m.last_fix[axis]
        same = same and given.gps_velocity[axis] == m.last_fix[3 + axis]
        m.last_fix[axis], m.last_fix[3 + axis] = given.gps_position[axis], given.gps_velocity[axis]
    m.repeated_fixes = m.repeated_fixes + 1 if same else 0
    lively = f.p.gps_velocity_std[0] > LIVELY_VELOCITY
    return bool(lively and m.vehicle_mode == FLYING and m.repeated_fixes >= STALE_FIXES)


SUSPICION_BLEND = 0.03
SUSPICION_LIMIT = 0.45
"""Of the running mean of GPS height innovations (33 fixes), in standard deviations: 3.7 of its own."""
SUSPECTED_OFFSET_STD = 1.0
"""m"""
OUTAGE = 1.0
"""s without an accepted fix, after which corrections slip."""
SLIPPING = 3.0
"""s from the first fix after an outage, in which they do."""


@kernel
def _suspect_barometer(f: Filter, normalised: float) -> None:
    """Height innovations of GPS that lean to one side: the barometer drifts faster than its model allows."""
    m = f.m
    m.height_suspicion += SUSPICION_BLEND * (normalised - m.height_suspicion)
    if abs(m.height_suspicion) > SUSPICION_LIMIT:
        m.height_suspicion = 0.0
        f.P[BARO_OFFSET, BARO_OFFSET] += SUSPECTED_OFFSET_STD**2


@kernel
def _slip(f: Filter) -> None:
    """Note what the correction to come moves after an outage, so that `report` can spread it out."""
    m, correction = f.m, f.vectors[CORRECTION]
    if m.time < m.slip_until and m.vehicle_mode == FLYING:
        for i in range(6):
            m.slip[i] += correction[POSITION + i]


@kernel
def tracker(f: Filter, given: Any) -> None:
    """The load's place relative to the vehicle, m, body FLU, at the time of the picture."""
    m = f.m
    measure_cable(f, given)
    slot = recall(f, CLONE_LOAD, given.tracker_time)
    if slot < 0:
        return
    base = slot * CLONE_ROWS
    worst, squares = 0.0, 0.0
    begin(f)
    for axis in range(3):
        std = given.tracker_std[axis]
        innovation = given.tracker[axis] - f.z[base + axis]
        variance = f.Pzz[base + axis, base + axis] + std * std
        worst = max(worst, gate_ratio(f, TRACKER, axis, innovation, variance))
    if accept(f, TRACKER, worst):
        for axis in range(3):
            std = given.tracker_std[axis]
            k = base + axis
            squares += fuse_remembered(f, k, k, m.innovation[TRACKER, axis], std * std)
        inject(f)
        record_nis(f, TRACKER, squares, 3)
    forget(f, CLONE_LOAD, given.tracker_time)
