"""What is known without a sensor: at rest nothing moves, and what stands is at the height of the ground."""

from __future__ import annotations

from controller.estimator.correct.update import ROW, begin, fuse, inject
from controller.estimator.records import (
    LOAD,
    LOAD_VELOCITY,
    POSITION,
    RATES,
    VELOCITY,
    X_LOAD,
    X_LOAD_VELOCITY,
    X_POSITION,
    X_RATES,
    X_VELOCITY,
    Filter,
)
from sitl_bridge.compiled import kernel

HEIGHT_STD = 0.3
"""m, of one look at the ground's height: taken at every tick, it is a soft hold and no new fact each time."""


@kernel
def rest(f: Filter) -> None:
    """Pseudo-measurements of a vehicle that stands: no velocity, no turning, the load at rest too."""
    x = f.x
    begin(f)
    for axis in range(3):
        f.vectors[ROW, VELOCITY + axis] = 1.0
        fuse(f, -x[X_VELOCITY + axis], 0.05**2)
        f.vectors[ROW, RATES + axis] = 1.0
        fuse(f, -x[X_RATES + axis], 0.02**2)
        f.vectors[ROW, LOAD_VELOCITY + axis] = 1.0
        fuse(f, -x[X_LOAD_VELOCITY + axis], 0.05**2)
    inject(f)


@kernel
def on_ground(f: Filter) -> None:
    """Pseudo-measurement of a vehicle that stands on the ground: its height."""
    begin(f)
    f.vectors[ROW, POSITION + 2] = 1.0
    fuse(f, f.p.standing_height - f.x[X_POSITION + 2], HEIGHT_STD**2)
    inject(f)


@kernel
def load_at_rest(f: Filter) -> None:
    """Pseudo-measurements of a load on the ground: its own velocity is zero, and its height."""
    p, x = f.p, f.x
    begin(f)
    for axis in range(3):
        f.vectors[ROW, VELOCITY + axis], f.vectors[ROW, LOAD_VELOCITY + axis] = 1.0, 1.0
        fuse(f, -x[X_VELOCITY + axis] - x[X_LOAD_VELOCITY + axis], 0.1**2)
    if p.has_ground:
        f.vectors[ROW, POSITION + 2], f.vectors[ROW, LOAD + 2] = 1.0, 1.0
        fuse(f, p.lying_height - x[X_POSITION + 2] - x[X_LOAD + 2], HEIGHT_STD**2)
    inject(f)
