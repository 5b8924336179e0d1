"""Who shapes a local path: a target, the limits on the way to it, and how far the motion is.

One record, a field of `reference.PATH`: `approach` goes on with it by one step at a time.
"""

from __future__ import annotations

import numpy as np

DERIVATIVES = 5
"""Derivatives of a feasible path that are continuous, the position's own not counted."""
BASE = 4
"""Position and derivatives of a base"""

POINT, LANDING, MOVING = 0, 1, 2
"""What a target is: a point to stop at, one to sink above, a set-point that somebody moves."""

LIMITS = np.dtype(
    [
        ("acceleration", "f8"),  # m/s², with which a gap is closed
        ("total", "f8"),  # m/s², that and the set-point's own together
        ("speed", "f8"),  # m/s, horizontal, where a target has none of its own
        ("up", "f8"),  # m/s
        ("down", "f8"),  # m/s
        ("floor", "f8"),  # m, below which nothing but a landing sinks; -inf: none
    ]
)

GUIDE = np.dtype(
    [
        ("active", "i8"),  # 1: the control step goes on with it, before the law
        ("period", "f8"),  # s, of a step
        ("feedback", "f8", DERIVATIVES),  # of the reference model
        ("ahead", "f8", BASE),  # the carrot that belongs to a motion: c = (1 + D/pole)^5 r
        ("own", "f8", (DERIVATIVES, DERIVATIVES)),  # what a period makes of a gap
        ("pull", "f8", (DERIVATIVES, 3)),  # what the carrot adds to that
        ("coast", "f8", (BASE, BASE)),  # what a period makes of a base
        ("kind", "i8"),  # of the target: POINT, LANDING, MOVING
        ("target", "f8", 3),  # m; NaN: not asked for
        ("speed", "f8"),  # m/s, largest on the way, or downwards
        ("yaw", "f8"),  # rad, that is asked for; NaN: none
        ("yaw_rate", "f8"),  # rad/s, likewise
        ("limits", LIMITS),
        ("base", "f8", (BASE, 3)),  # position, velocity, acceleration, jerk
        ("gap", "f8", (DERIVATIVES + 1, 3)),  # position and derivatives
        ("carrot", "f8", (3, 3)),  # position, velocity, acceleration
        ("age", "f8"),  # s since the target was given
        ("sinking", "f8"),  # m/s, of the whole
        ("scratch", "f8", (DERIVATIVES, 3)),
    ]
)
"""The motion is the sum of base and gap, see `approach`."""
