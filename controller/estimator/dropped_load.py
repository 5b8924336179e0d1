"""A load that the gripper lets go: it falls, or stays where it lies, and waits there for the hook."""

from __future__ import annotations

import math

from controller.estimator.contact_modes import SET_DOWN_STD, lie_still
from controller.estimator.correct.update import set_part
from controller.estimator.records import (
    LOAD,
    LOAD_DROPPED,
    LOAD_ON_CABLE,
    LOAD_VELOCITY,
    VELOCITY,
    X_LOAD,
    X_LOAD_VELOCITY,
    X_POSITION,
    X_VELOCITY,
    Filter,
)
from sitl_bridge.compiled import kernel

ROLLING = 0.05
"""Of the height of its fall: how far a load rolls from where it has hit the ground, standard deviation."""


@kernel
def drop(f: Filter) -> None:
    """The hook has opened; from now on the load counts as lying where it will come to rest."""
    p, m, x, cov = f.p, f.m, f.x, f.P
    if m.load_mode == LOAD_ON_CABLE:
        height = max(0.0, x[X_POSITION + 2] + x[X_LOAD + 2] - p.lying_height)
        up = x[X_VELOCITY + 2] + x[X_LOAD_VELOCITY + 2]
        time = (up + math.sqrt(up * up + 2.0 * p.gravity * height)) / p.gravity
        for axis in range(2):
            r, s, v = LOAD + axis, LOAD_VELOCITY + axis, VELOCITY + axis
            x[X_LOAD + axis] += time * (x[X_VELOCITY + axis] + x[X_LOAD_VELOCITY + axis])
            speed = cov[v, v] + 2.0 * cov[v, s] + cov[s, s]
            spread = cov[r, r] + time * time * speed + SET_DOWN_STD**2 + (ROLLING * height) ** 2
            set_part(f, r, 1, math.sqrt(spread))
        lie_still(f)
    m.load_mode = LOAD_DROPPED
