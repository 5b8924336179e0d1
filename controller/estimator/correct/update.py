"""One scalar measurement at a time: gain, Joseph's form of the covariance, and the remembered instants.

A vector measurement is a row of scalars with independent noise. Their corrections add up in `CORRECTION`
and reach the nominal state together (`inject`), so that the gate can still refuse the whole vector before.

Rows of `Filter.vectors`: 0 and 1 belong to callers' small scratch, the rest is named here.
"""

from __future__ import annotations

import math

from controller.estimator.predict.rotation import turn
from controller.estimator.records import (
    ATTITUDE,
    CLONE_SIZE,
    ERROR_SIZE,
    LOAD,
    LOAD_ON_CABLE,
    X_ATTITUDE,
    X_LOAD,
    X_RATES,
    Array,
    Filter,
)
from sitl_bridge.compiled import kernel

SCRATCH = 2
"""Free between calls."""
ROW = 3
"""The measurement row h (ERROR_SIZE,); what measures writes it, what takes it in clears it."""
CORRECTION = 4
"""The correction of the error state that the scalars so far ask for (ERROR_SIZE,)."""
SHARED = 5
"""P h (ERROR_SIZE,)."""
SHARED_CLONES = 6
"""Covariance of the remembered quantities with the measured one (CLONE_SIZE,)."""
CORRECTION_CLONES = 7
"""The correction of the remembered quantities (CLONE_SIZE,)."""

SMALLEST_SWING = 1e-6
"""rad; a smaller turn of the cable changes nothing."""


@kernel
def begin(f: Filter) -> None:
    """Start a vector measurement."""
    for i in range(ERROR_SIZE):
        f.vectors[ROW, i] = 0.0
        f.vectors[CORRECTION, i] = 0.0
    for i in range(CLONE_SIZE):
        f.vectors[CORRECTION_CLONES, i] = 0.0


@kernel
def collect(f: Filter) -> int:
    """List where the row h has entries, move them to the list, and clear the row; returns how many."""
    row, index, value = f.vectors[ROW], f.row_index, f.row_value
    count = 0
    for i in range(ERROR_SIZE):
        if row[i] != 0.0:
            index[count] = i
            value[count] = row[i]
            row[i] = 0.0
            count += 1
    return count


@kernel
def predicted_variance(f: Filter) -> float:
    """h'P h of the present row, which is cleared."""
    count = collect(f)
    cov, index, value, variance = f.P, f.row_index, f.row_value, 0.0
    for i in range(count):
        total = 0.0
        for j in range(count):
            total += cov[index[i], index[j]] * value[j]
        variance += total * value[i]
    return variance


@kernel
def fuse(f: Filter, innovation: float, noise: float) -> float:
    """Take in one scalar whose row h is in `vectors[ROW]`, and clear the row.

    innovation: measured minus predicted at the nominal state, before the corrections so far; noise: variance.
    Returns the normalised innovation squared, chi-square with one degree of freedom.
    """
    count = collect(f)
    index, value, cov = f.row_index, f.row_value, f.P
    shared, remembered, doubled = f.vectors[SHARED], f.vectors[SHARED_CLONES], f.vectors[SCRATCH]
    for j in range(ERROR_SIZE):
        shared[j] = 0.0
    for j in range(f.m.clone_width):
        remembered[j] = 0.0
    for n in range(count):
        factor, i = value[n], index[n]
        for j in range(ERROR_SIZE):
            shared[j] += factor * cov[i, j]
        for j in range(f.m.clone_width):
            remembered[j] += factor * f.Pxz[i, j]
    variance, left = noise, innovation
    for n in range(count):
        variance += value[n] * shared[index[n]]
        left -= value[n] * f.vectors[CORRECTION, index[n]]
    _apply(f, left, variance)
    # The second half of Joseph's form: (I - k h')P is there; times (I - k h')', plus k r k'.
    for j in range(ERROR_SIZE):
        doubled[j] = -noise / variance * shared[j]
    for n in range(count):
        factor, i = value[n], index[n]
        for j in range(ERROR_SIZE):
            doubled[j] += factor * cov[i, j]
    for i in range(ERROR_SIZE):
        factor = doubled[i] / variance
        for j in range(ERROR_SIZE):
            cov[i, j] -= factor * shared[j]
    return float(left * left / variance)


@kernel
def fuse_remembered(f: Filter, index: int, also: int, innovation: float, noise: float) -> float:
    """Take in one scalar that measures the remembered quantity `index`, plus that with the index `also`.

    also: the same index where there is no other. Otherwise as `fuse`.
    """
    shared, remembered = f.vectors[SHARED], f.vectors[SHARED_CLONES]
    for i in range(ERROR_SIZE):
        shared[i] = f.Pxz[i, index]
    for k in range(f.m.clone_width):
        remembered[k] = f.Pzz[index, k]
    left = innovation - f.vectors[CORRECTION_CLONES, index]
    if also != index:
        for i in range(ERROR_SIZE):
            shared[i] += f.Pxz[i, also]
        for k in range(f.m.clone_width):
            remembered[k] += f.Pzz[also, k]
        left -= f.vectors[CORRECTION_CLONES, also]
    variance = remembered_variance(f, index, also) + noise
    _apply(f, left, variance)
    return float(left * left / variance)


@kernel
def remembered_variance(f: Filter, index: int, also: int) -> float:
    """Variance of what `fuse_remembered` measures, without its noise."""
    if also == index:
        return float(f.Pzz[index, index])
    return float(f.Pzz[index, index] + 2.0 * f.Pzz[index, also] + f.Pzz[also, also])


@kernel
def _apply(f: Filter, left: float, variance: float) -> None:
    """Correct by one scalar: P - k u' with u = P h (in SHARED) and k = u / variance; clones likewise."""
    cov, shared, remembered = f.P, f.vectors[SHARED], f.vectors[SHARED_CLONES]
    correction, moved = f.vectors[CORRECTION], f.vectors[CORRECTION_CLONES]
    width = f.m.clone_width
    for i in range(ERROR_SIZE):
        gain = shared[i] / variance
        correction[i] += gain * left
        for j in range(ERROR_SIZE):
            cov[i, j] -= gain * shared[j]
        for j in range(width):
            f.Pxz[i, j] -= gain * remembered[j]
    for k in range(width):
        gain = remembered[k] / variance
        moved[k] += gain * left
        for j in range(width):
            f.Pzz[k, j] -= gain * remembered[j]


@kernel
def inject(f: Filter) -> None:
    """Move the corrections into nominal state and remembered quantities."""
    x, correction = f.x, f.vectors[CORRECTION]
    if f.m.adrift:  # the place is known to metres, and every hint at the velocity moves it by as much
        for i in range(3):
            f.m.slip[i] += correction[i]
    for i in range(ATTITUDE):
        x[i] += correction[i]
    turn(x, correction[ATTITUDE], correction[ATTITUDE + 1], correction[ATTITUDE + 2])
    rx, ry, rz = x[X_LOAD], x[X_LOAD + 1], x[X_LOAD + 2]
    for i in range(ATTITUDE + 3, ERROR_SIZE):
        x[i + X_RATES - X_ATTITUDE - 3] += correction[i]
    for k in range(f.m.clone_width):
        f.z[k] += f.vectors[CORRECTION_CLONES, k]
    if f.m.load_mode == LOAD_ON_CABLE:
        swing(f, rx, ry, rz)


@kernel
def swing(f: Filter, rx: float, ry: float, rz: float) -> None:
    """Take the correction of a hanging load, which was at (rx, ry, rz), for a turn and a stretch of it.

    The pull shows how long the cable is to millimetres, and where the load is to the side to decimetres.
    Moved along the tangent, the load would come to hang on a longer cable; and a covariance that is narrow
    along the old cable would, along the new one, claim to know the place to the side. So it turns as well.
    """
    correction, x, cov = f.vectors[CORRECTION], f.x, f.P
    length = math.sqrt(rx * rx + ry * ry + rz * rz) + 1e-9
    ex, ey, ez = rx / length, ry / length, rz / length
    dx, dy, dz = correction[LOAD], correction[LOAD + 1], correction[LOAD + 2]
    along = ex * dx + ey * dy + ez * dz
    dx, dy, dz = dx - along * ex, dy - along * ey, dz - along * ez
    across = math.sqrt(dx * dx + dy * dy + dz * dz)
    angle = across / length
    if angle < SMALLEST_SWING:
        return
    sine, cosine = math.sin(angle), math.cos(angle)
    dx, dy, dz = dx / across, dy / across, dz / across
    e, d, turn_by = (ex, ey, ez), (dx, dy, dz), f.vectors[SCRATCH]
    for i in range(3):
        x[X_LOAD + i] = (length + along) * (cosine * e[i] + sine * d[i])
        for j in range(3):  # the rotation that takes e to cos e + sin d
            turn_by[3 * i + j] = (cosine - 1.0) * (e[i] * e[j] + d[i] * d[j])
            turn_by[3 * i + j] += sine * (d[i] * e[j] - e[i] * d[j])
        turn_by[4 * i] += 1.0
    _turn_rows(turn_by, f.Pxz, 0, f.m.clone_width)
    _turn_rows(turn_by, cov, 0, ERROR_SIZE)
    for i in range(LOAD, LOAD + 3):
        for j in range(ERROR_SIZE):
            if j < LOAD or j >= LOAD + 3:
                cov[j, i] = cov[i, j]
        for j in range(LOAD, i):  # the block is turned from the left; transposed and turned again it is whole
            cov[i, j], cov[j, i] = cov[j, i], cov[i, j]
    _turn_rows(turn_by, cov, LOAD, LOAD + 3)
    for i in range(LOAD, LOAD + 3):
        for j in range(LOAD, i):
            cov[i, j] = cov[j, i]


@kernel
def _turn_rows(turn_by: Array, matrix: Array, start: int, end: int) -> None:
    """Multiply the load's rows of a matrix by a rotation (9,) from the left, in columns start to end."""
    for j in range(start, end):
        a, b, c = matrix[LOAD, j], matrix[LOAD + 1, j], matrix[LOAD + 2, j]
        for i in range(3):
            matrix[LOAD + i, j] = turn_by[3 * i] * a + turn_by[3 * i + 1] * b + turn_by[3 * i + 2] * c


@kernel
def set_part(f: Filter, start: int, size: int, std: float) -> None:
    """Forget what the covariance knows about a part, and give it this standard deviation."""
    for i in range(start, start + size):
        for j in range(ERROR_SIZE):
            f.P[i, j] = 0.0
            f.P[j, i] = 0.0
        for k in range(CLONE_SIZE):
            f.Pxz[i, k] = 0.0
        f.P[i, i] = std * std
