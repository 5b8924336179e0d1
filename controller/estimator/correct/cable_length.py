"""The cable's length, where a tracker sees how far away the load is.

The model knows the load's distance by the pull: rest length plus stretch. A cable that is longer than told
makes the load hang lower than believed by as much, which neither GPS nor the inertial sensors show. A picture
does: its distance less the stretch is the rest length.
"""

from __future__ import annotations

import math
from typing import Any

from controller.estimator.records import LOAD_ON_CABLE, X_LOAD, Filter
from sitl_bridge.compiled import kernel

USUAL_ERROR = 0.1
"""Of the length, standard deviation of what is told of it"""
MOST_ERROR = 0.3
"""Likewise: more is another object in the picture"""
MOTION_ERROR = 0.03
"""Likewise, of one picture: the load moves along the cable meanwhile"""
HANGING = 0.7
"""Of the load's weight, that pulls at least"""
SLEW = 0.1
"""m/s, at which the load is moved along its cable: a law that is fed back has to follow it"""


@kernel
def measure_cable(f: Filter, given: Any) -> None:
    """Compare the distance in a picture with the pull, and correct the cable's length."""
    p, m, x = f.p, f.m, f.x
    pull = math.sqrt(m.pull[0] ** 2 + m.pull[1] ** 2 + m.pull[2] ** 2)
    if m.load_mode != LOAD_ON_CABLE or m.tension <= 0.0 or pull < HANGING * p.load_mass * p.gravity:
        return
    seen = math.sqrt(given.tracker[0] ** 2 + given.tracker[1] ** 2 + given.tracker[2] ** 2)
    longer = seen - pull / p.stiffness - p.rest_length
    if not abs(longer + m.cable_longer) < MOST_ERROR * p.rest_length:  # also where it is not a number
        return
    if m.cable_variance == 0.0:
        m.cable_variance = (USUAL_ERROR * p.rest_length) ** 2
    gain = m.cable_variance / (
        m.cable_variance + given.tracker_std[2] ** 2 + (MOTION_ERROR * p.rest_length) ** 2
    )
    most = SLEW * p.tracker_interval
    change = min(most, max(-most, gain * longer))
    if abs(gain * longer) < most:
        m.cable_variance *= 1.0 - gain
    m.cable_longer += change
    p.rest_length += change
    stretched = 1.0 + change / math.sqrt(x[X_LOAD] ** 2 + x[X_LOAD + 1] ** 2 + x[X_LOAD + 2] ** 2)
    for axis in range(3):
        x[X_LOAD + axis] *= stretched
