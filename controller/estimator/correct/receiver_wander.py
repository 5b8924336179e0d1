"""The error of a GPS receiver that wanders by metres within a minute: multipath among buildings.

Taken for white noise, it would be averaged over a hundred fixes and then believed. It is a state of its own
instead, among the remembered quantities, whose cost is nothing where a receiver does not wander: a fix is the
remembered position plus the present error. Velocity and barometer, which do not wander, then tell one from
the other.
"""

from __future__ import annotations

import math

from controller.estimator.records import (
    CLONE_ROWS,
    CLONE_SIZE,
    CLONE_WANDER,
    ERROR_SIZE,
    POSITION,
    Filter,
)
from sitl_bridge.compiled import kernel

WANDER = 0
"""Slot of the remembered quantities that holds it."""


@kernel
def begin_wander(f: Filter, has_fix: bool) -> None:
    """Set the error to none, in doubt by what it usually is; has_fix: the position is that of a fix."""
    p, m = f.p, f.m
    if not wanders(f):
        return
    m.clone_kind[WANDER] = CLONE_WANDER
    m.clone_width = max(m.clone_width, CLONE_ROWS)
    for k in range(CLONE_ROWS):
        f.z[k] = 0.0
        for j in range(CLONE_SIZE):
            f.Pzz[k, j] = f.Pzz[j, k] = 0.0
        for i in range(ERROR_SIZE):
            f.Pxz[i, k] = 0.0
    for axis in range(3):
        variance = p.gps_wander_std[axis] * p.gps_wander_std[axis]
        f.Pzz[axis, axis] = variance
        if has_fix:
            f.Pxz[POSITION + axis, axis] = -variance


@kernel
def wanders(f: Filter) -> bool:
    """Whether the receiver does."""
    std = f.p.gps_wander_std
    return bool(std[0] > 0.0 or std[1] > 0.0 or std[2] > 0.0)


@kernel
def fade_wander(f: Filter) -> None:
    """The error over one period: it fades, and as much comes anew."""
    p, m = f.p, f.m
    if m.clone_kind[WANDER] != CLONE_WANDER:
        return
    fade = math.exp(-p.period / p.gps_wander_time)
    for axis in range(3):
        f.z[axis] *= fade
        for i in range(ERROR_SIZE):
            f.Pxz[i, axis] *= fade
        for k in range(m.clone_width):
            f.Pzz[axis, k] *= fade
            f.Pzz[k, axis] *= fade
        f.Pzz[axis, axis] += (1.0 - fade * fade) * p.gps_wander_std[axis] ** 2
