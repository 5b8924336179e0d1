"""Changes of model: slack and taut, load on the ground, load gone. A surprise is not divergence."""

from __future__ import annotations

import math
from typing import Any

from controller.estimator.layout import (
    ACCELEROMETER,
    FLYING,
    LOAD,
    LOAD_ON_CABLE,
    LOAD_ON_GROUND,
    LOAD_RELEASED,
    LOAD_VELOCITY,
    X_LOAD,
    X_LOAD_VELOCITY,
    X_POSITION,
    X_VELOCITY,
    Filter,
)
from controller.estimator.sensors import measured_pull
from controller.estimator.update import set_part
from sitl_bridge.compiled import kernel

PULL_TIME = 0.04
"""s, over which the measured pull of the cable is smoothed."""
CONFIRM_TIME = 0.06
"""s: so long the measured pull has to contradict the model."""
RELEASE_TIME = 1.5
"""s without any pull in the air: a load on its cable would have fallen into it before."""
IMPOSSIBLE_PULL = 1e3
"""Of the load's weight; a sensor that shows that, or no number, shows nothing."""
GROUND_MARGIN = 0.5
"""m: a slack cable with the load this low means that the load lies on the ground."""


@kernel
def watch(f: Filter, measured: Any) -> None:
    """Compare the pull that the accelerometer shows with what the model says, and change the model."""
    p, m, x = f.p, f.m, f.x
    if m.vehicle_mode != FLYING:
        return
    out = f.vectors[0]
    if not measured_pull(f, measured, out) < IMPOSSIBLE_PULL * p.load_mass * p.gravity:
        return
    blend = p.period / PULL_TIME
    for axis in range(3):
        m.pull[axis] += blend * (out[axis] - m.pull[axis])
    pull = math.sqrt(m.pull[0] ** 2 + m.pull[1] ** 2 + m.pull[2] ** 2)
    weight = p.load_mass * p.gravity
    if m.rejected_in_row[ACCELEROMETER] * p.period > CONFIRM_TIME:
        # The accelerometer and the model have parted: where the load is has to be found again.
        m.rejected_in_row[ACCELEROMETER] = 0
        if m.load_mode == LOAD_ON_CABLE:
            place_load(f, pull)
    if p.two_way:
        return
    # What smoothing leaves of noise and unmodelled force, three standard deviations.
    noise = math.sqrt(p.sensor_std[ACCELEROMETER] ** 2 + p.force_std**2)
    floor = 3.0 * p.vehicle_mass * noise * math.sqrt(blend)
    floor = max(floor, 0.2 * weight)
    slack = pull < floor
    m.slack_time = m.slack_time + p.period if slack else 0.0
    surprising = not slack and (m.load_mode == LOAD_RELEASED or m.tension <= 0.0)
    m.pull_time = m.pull_time + p.period if surprising else 0.0
    if m.load_mode == LOAD_ON_GROUND:
        if -m.pull[2] > 0.95 * weight:
            m.load_mode = LOAD_ON_CABLE
            place_load(f, pull)
    elif m.pull_time > CONFIRM_TIME:
        m.load_mode = LOAD_ON_CABLE
        m.pull_time = 0.0
        place_load(f, pull)
    elif m.load_mode == LOAD_ON_CABLE and slack and m.tension <= 0.0:
        low = x[X_POSITION + 2] + x[X_LOAD + 2] < GROUND_MARGIN
        if p.has_ground and low and m.slack_time > 0.2:
            m.load_mode = LOAD_ON_GROUND
            for axis in range(3):
                x[X_LOAD_VELOCITY + axis] = -x[X_VELOCITY + axis]
        elif m.slack_time > RELEASE_TIME:
            release(f)


@kernel
def place_load(f: Filter, pull: float) -> None:
    """Put the load where the measured pull points, with an honest uncertainty; `pull`: its size in N."""
    p, m, x = f.p, f.m, f.x
    m.load_resets += 1
    length = math.sqrt(x[X_LOAD] ** 2 + x[X_LOAD + 1] ** 2 + x[X_LOAD + 2] ** 2)
    if pull > 0.2 * p.load_mass * p.gravity:
        length = p.rest_length + pull / p.stiffness
        for axis in range(3):
            x[X_LOAD + axis] = m.pull[axis] / pull * length
            x[X_LOAD_VELOCITY + axis] = 0.0
    elif length > p.rest_length and not p.two_way:
        for axis in range(3):
            x[X_LOAD + axis] *= 0.98 * p.rest_length / length
    set_part(f, LOAD, 3, 0.15 * length)
    set_part(f, LOAD_VELOCITY, 3, 1.5)


@kernel
def release(f: Filter) -> None:
    """The load is gone: nothing pulls any more, and nothing is known of it."""
    f.m.load_mode = LOAD_RELEASED
    length = f.p.rest_length + f.p.load_mass * f.p.gravity / f.p.stiffness
    for axis in range(3):
        f.x[X_LOAD + axis] = -length if axis == 2 else 0.0
        f.x[X_LOAD_VELOCITY + axis] = 0.0
    set_part(f, LOAD, 3, length)
    set_part(f, LOAD_VELOCITY, 3, 1.0)
