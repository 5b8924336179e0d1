"""One scalar measurement at a time: gain, Joseph's form of the covariance, and the remembered instants.

A vector measurement is a row of scalars with independent noise. Their corrections add up in `CORRECTION`
and reach the nominal state together (`inject`), so that the gate can still refuse the whole vector before.

Rows of `Filter.vectors`: 0 and 1 belong to callers' small scratch, the rest is named here.
"""

from __future__ import annotations

from controller.estimator.layout import (
    ATTITUDE,
    CLONE_FREE,
    CLONE_ROWS,
    CLONES,
    ERROR_SIZE,
    X_ATTITUDE,
    X_RATES,
    Filter,
)
from controller.estimator.rotation import turn
from sitl_bridge.compiled import kernel

SCRATCH = 2
"""Free between calls."""
ROW = 3
"""The measurement row h (ERROR_SIZE,), dense; only where it is not zero does it cost."""
CORRECTION = 4
"""The correction of the error state that the scalars so far ask for (ERROR_SIZE,)."""
SHARED = 5
"""P h (ERROR_SIZE,)."""
SHARED_CLONES = 6
"""Covariance of the remembered quantities with the measured one (CLONE_SIZE,)."""
CORRECTION_CLONES = 7
"""The correction of the remembered quantities (CLONE_SIZE,)."""


@kernel
def begin(f: Filter) -> None:
    """Start a vector measurement."""
    for i in range(ERROR_SIZE):
        f.vectors[ROW, i] = 0.0
        f.vectors[CORRECTION, i] = 0.0
    for i in range(CLONES * CLONE_ROWS):
        f.vectors[CORRECTION_CLONES, i] = 0.0


@kernel
def project(f: Filter) -> float:
    """Write P h and the clones' part for the present row h; returns h'P h, the predicted variance."""
    shared, cov, row = f.vectors[SHARED], f.P, f.vectors[ROW]
    for j in range(ERROR_SIZE):
        shared[j] = 0.0
    for i in range(ERROR_SIZE):
        factor = row[i]
        if factor != 0.0:
            for j in range(ERROR_SIZE):
                shared[j] += factor * cov[i, j]
    variance = 0.0
    for i in range(ERROR_SIZE):
        variance += row[i] * shared[i]
    return variance


@kernel
def fuse(f: Filter, innovation: float, noise: float) -> float:
    """Take in one scalar whose row h is in `vectors[ROW]`, and clear the row.

    innovation: measured minus predicted at the nominal state, before the corrections so far; noise: variance.
    Returns the normalised innovation squared, chi-square with one degree of freedom.
    """
    row, shared = f.vectors[ROW], f.vectors[SHARED]
    prior = project(f)
    remembered = f.vectors[SHARED_CLONES]
    for clone in range(CLONES):
        if f.m.clone_kind[clone] != CLONE_FREE:
            for k in range(clone * CLONE_ROWS, (clone + 1) * CLONE_ROWS):
                total = 0.0
                for i in range(ERROR_SIZE):
                    total += f.Pzx[k, i] * row[i]
                remembered[k] = total
    left = innovation
    for i in range(ERROR_SIZE):
        left -= row[i] * f.vectors[CORRECTION, i]
    _apply(f, left, prior + noise)
    # The second half of Joseph's form: (I - k h')P is there; times (I - k h')', plus k r k'.
    cov, doubled = f.P, f.vectors[SCRATCH]
    for j in range(ERROR_SIZE):
        doubled[j] = -noise * shared[j] / (prior + noise)
    for i in range(ERROR_SIZE):
        factor = row[i]
        row[i] = 0.0
        if factor != 0.0:
            for j in range(ERROR_SIZE):
                doubled[j] += factor * cov[i, j]
    for i in range(ERROR_SIZE):
        factor = doubled[i] / (prior + noise)
        for j in range(ERROR_SIZE):
            cov[i, j] -= factor * shared[j]
    return left * left / (prior + noise)


@kernel
def fuse_remembered(f: Filter, index: int, innovation: float, noise: float) -> float:
    """Take in one scalar that measures the remembered quantity `index`; otherwise as `fuse`."""
    shared = f.vectors[SHARED]
    for i in range(ERROR_SIZE):
        shared[i] = f.Pzx[index, i]
    remembered = f.vectors[SHARED_CLONES]
    for clone in range(CLONES):
        if f.m.clone_kind[clone] != CLONE_FREE:
            for k in range(clone * CLONE_ROWS, (clone + 1) * CLONE_ROWS):
                remembered[k] = f.Pzz[k, index]
    prior = f.Pzz[index, index]
    left = innovation - f.vectors[CORRECTION_CLONES, index]
    _apply(f, left, prior + noise)
    return left * left / (prior + noise)


@kernel
def _apply(f: Filter, left: float, variance: float) -> None:
    """Correct by one scalar: P - k u' with u = P h (in SHARED) and k = u / variance; clones likewise."""
    cov, shared, remembered = f.P, f.vectors[SHARED], f.vectors[SHARED_CLONES]
    inverse = 1.0 / variance
    for i in range(ERROR_SIZE):
        gain = shared[i] * inverse
        f.vectors[CORRECTION, i] += gain * left
        for j in range(ERROR_SIZE):
            cov[i, j] -= gain * shared[j]
    for clone in range(CLONES):
        if f.m.clone_kind[clone] == CLONE_FREE:
            continue
        for k in range(clone * CLONE_ROWS, (clone + 1) * CLONE_ROWS):
            gain = remembered[k] * inverse
            f.vectors[CORRECTION_CLONES, k] += gain * left
            for j in range(ERROR_SIZE):
                f.Pzx[k, j] -= gain * shared[j]
            for other in range(CLONES):
                if f.m.clone_kind[other] != CLONE_FREE:
                    for j in range(other * CLONE_ROWS, (other + 1) * CLONE_ROWS):
                        f.Pzz[k, j] -= gain * remembered[j]


@kernel
def inject(f: Filter) -> None:
    """Move the corrections into nominal state and remembered quantities."""
    x, correction = f.x, f.vectors[CORRECTION]
    for i in range(ATTITUDE):
        x[i] += correction[i]
    turn(x, correction[ATTITUDE], correction[ATTITUDE + 1], correction[ATTITUDE + 2])
    for i in range(ATTITUDE + 3, ERROR_SIZE):
        x[i + X_RATES - X_ATTITUDE - 3] += correction[i]
    for clone in range(CLONES):
        if f.m.clone_kind[clone] != CLONE_FREE:
            for k in range(clone * CLONE_ROWS, (clone + 1) * CLONE_ROWS):
                f.z[k] += f.vectors[CORRECTION_CLONES, k]


@kernel
def set_part(f: Filter, start: int, size: int, std: float) -> None:
    """Forget what the covariance knows about a part, and give it this standard deviation."""
    for i in range(start, start + size):
        for j in range(ERROR_SIZE):
            f.P[i, j] = 0.0
            f.P[j, i] = 0.0
        for k in range(CLONES * CLONE_ROWS):
            f.Pzx[k, i] = 0.0
        f.P[i, i] = std * std
