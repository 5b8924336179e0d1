"""The motion that belongs to a reference path, compiled: state and wrench of the feed-forward."""

from __future__ import annotations

from typing import Any

import numpy as np

from controller.law.flatness import BODY, STENCIL, flat_motion
from controller.law.reference import PATH
from controller.law.state import STATE_SIZE, WRENCH_SIZE, Array
from sitl_bridge.compiled import Buffer, entry_point


@entry_point(
    Buffer(BODY, (1,)),
    Buffer(PATH, (1,)),
    Buffer(STENCIL, (1,)),
    Buffer(np.float64, (2,)),
    Buffer(np.float64, (STATE_SIZE,)),
    Buffer(np.float64, (WRENCH_SIZE,)),
    float,
    float,
)
def path_motion(
    bodies: Any,
    paths: Any,
    stencils: Any,
    heading: Array,
    state: Array,
    wrench: Array,
    time_s: float,
    lead: float,
) -> int:
    """x* (18,), eq. 31, at a time of the path, and u* (4,) `lead` s later; heading as for `flat_motion`."""
    flat_motion(bodies[0], paths[0], time_s, lead, 0.0, heading, stencils[0], state, wrench)
    return 0
