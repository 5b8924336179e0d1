"""The covariance over one step: P = Phi P Phi' + Q, with Phi's zeros left out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from controller.estimator.records import (
    ACCEL_BIAS,
    ATTITUDE,
    BARO_OFFSET,
    ERROR_SIZE,
    FORCE,
    GYRO_BIAS,
    LOAD,
    LOAD_MASS,
    LOAD_ON_CABLE,
    LOAD_RELEASED,
    LOAD_VELOCITY,
    LOAD_WIND,
    POSITION,
    RATES,
    STANDING,
    VELOCITY,
    Array,
    Filter,
)
from sitl_bridge.compiled import kernel


def _pattern() -> tuple[Any, Any]:
    """Rows of the transition matrix that are not those of the identity: (row starts, column indices).

    A row without entries is the identity's; start and end of row i are starts[i] and starts[i + 1].
    """
    columns: list[list[int]] = [[] for _ in range(ERROR_SIZE)]

    def block(start: int) -> list[int]:
        return [start, start + 1, start + 2]

    for i in range(3):
        around = block(ATTITUDE) + block(RATES) + block(LOAD) + block(LOAD_VELOCITY) + block(FORCE)
        winds = [*block(LOAD_WIND), LOAD_MASS]
        columns[POSITION + i] = [POSITION + i, VELOCITY + i, *around, *winds]
        columns[VELOCITY + i] = [VELOCITY + i, *around, *winds]
        columns[ATTITUDE + i] = block(ATTITUDE) + block(RATES)
        columns[RATES + i] = block(RATES)
        columns[LOAD + i] = [*around, *winds, VELOCITY + i]
        columns[LOAD_VELOCITY + i] = [*around, *winds, VELOCITY + i]
        columns[FORCE + i] = [FORCE + i]
    starts = np.cumsum([0, *(len(row) for row in columns)])
    return starts.astype(np.int64), np.array([c for row in columns for c in row], dtype=np.int64)


ROW_STARTS, COLUMNS = _pattern()


@kernel
def propagate(f: Filter) -> None:
    """P = Phi P Phi', exactly symmetric; and the covariance with the remembered instants."""
    phi, cov, first, second = f.transition, f.P, f.scratch[0], f.scratch[1]
    _rows(phi, cov, first, ERROR_SIZE, False)
    for i in range(ERROR_SIZE):
        for j in range(ERROR_SIZE):
            second[i, j] = first[j, i]
    _rows(phi, second, first, ERROR_SIZE, True)
    for i in range(ERROR_SIZE):
        for j in range(i + 1):
            cov[i, j] = first[i, j]
            cov[j, i] = first[i, j]
    width = f.m.clone_width
    if width > 0:
        _rows(phi, f.Pxz, f.wide, width, False)
        for i in range(ERROR_SIZE):
            for j in range(width):
                f.Pxz[i, j] = f.wide[i, j]


@kernel
def _rows(phi: Array, source: Array, out: Array, width: int, lower: bool) -> None:
    """out = Phi source, `width` columns of it or only those up to the diagonal, using where Phi has entries.

    Four of them at a time: that is what keeps the processor's multipliers busy.
    """
    for i in range(ERROR_SIZE):
        index, end = ROW_STARTS[i], ROW_STARTS[i + 1]
        to = out[i]
        count = i + 1 if lower else width
        if index == end:
            one = source[i]
            for j in range(count):
                to[j] = one[j]
            continue
        for j in range(count):
            to[j] = 0.0
        while index + 3 < end:
            a, b, c, d = COLUMNS[index], COLUMNS[index + 1], COLUMNS[index + 2], COLUMNS[index + 3]
            fa, fb, fc, fd = phi[i, a], phi[i, b], phi[i, c], phi[i, d]
            one, two, three, four = source[a], source[b], source[c], source[d]
            for j in range(count):
                to[j] += fa * one[j] + fb * two[j] + fc * three[j] + fd * four[j]
            index += 4
        while index < end:
            a = COLUMNS[index]
            fa, one = phi[i, a], source[a]
            for j in range(count):
                to[j] += fa * one[j]
            index += 1


@kernel
def _pair(cov: Array, i: int, j: int, value: float) -> None:
    cov[i, j] += value
    cov[j, i] += value


@kernel
def add_noise(f: Filter, step: float) -> None:
    """Add what one step's unknown forces, moments and drifts contribute."""
    p, cov, m = f.p, f.P, f.m
    standing = m.vehicle_mode == STANDING
    tau = p.force_time
    fade = math.exp(-step / tau)
    variance = p.force_std * p.force_std
    # Ornstein-Uhlenbeck force: its value at the end, the velocity it gave, and both together.
    ends = variance * (1.0 - fade * fade)
    gains = variance * tau * tau * (2.0 * step / tau - 3.0 + 4.0 * fade - fade * fade)
    gains += p.gust_density * p.gust_density * step
    joint = variance * tau * (1.0 - fade) * (1.0 - fade)
    load = p.load_force_density * p.load_force_density * step
    torque = p.torque_density * p.torque_density * step
    if m.load_mode != LOAD_ON_CABLE:
        load = 0.0
    if standing:
        gains, joint, load = 1e-4 * step, 0.0, 1e-4 * step
    relative = 0.0 if m.load_mode == LOAD_RELEASED else 1.0
    third = step * step / 3.0
    half = 0.5 * step
    for i in range(3):
        r, s, v, q, w = LOAD + i, LOAD_VELOCITY + i, VELOCITY + i, POSITION + i, FORCE + i
        spin = torque / (p.inertia[i] * p.inertia[i])
        if standing:
            spin = 1e-4 * step
        cov[w, w] += ends
        cov[v, v] += gains
        cov[q, q] += gains * third
        _pair(cov, q, v, gains * half)
        _pair(cov, v, w, joint)
        _pair(cov, q, w, joint * half)
        common = 0.0 if standing else relative
        cov[s, s] += gains * common + load
        cov[r, r] += (gains * common + load) * third
        _pair(cov, r, s, (gains * common + load) * half)
        _pair(cov, s, v, -gains * common)
        _pair(cov, s, q, -gains * half * common)
        _pair(cov, r, v, -gains * half * common)
        _pair(cov, r, q, -gains * third * common)
        _pair(cov, s, w, -joint * common)
        _pair(cov, r, w, -joint * half * common)
        cov[RATES + i, RATES + i] += spin
        cov[ATTITUDE + i, ATTITUDE + i] += spin * third
        _pair(cov, ATTITUDE + i, RATES + i, spin * half)
        cov[GYRO_BIAS + i, GYRO_BIAS + i] += p.gyro_bias_walk * p.gyro_bias_walk * step
        cov[ACCEL_BIAS + i, ACCEL_BIAS + i] += p.accel_bias_walk * p.accel_bias_walk * step
        cov[LOAD_WIND + i, LOAD_WIND + i] += p.load_wind_walk * p.load_wind_walk * step
    cov[BARO_OFFSET, BARO_OFFSET] += p.baro_walk * p.baro_walk * step
    cov[LOAD_MASS, LOAD_MASS] += p.load_mass_walk * p.load_mass_walk * step
