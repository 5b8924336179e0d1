"""The feed-forward's motion, compiled: thousands of instants in a moment."""

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
    float,
)
def motion(
    bodies: Any,
    paths: Any,
    stencils: Any,
    heading: Array,
    state: Array,
    wrench: Array,
    time_s: float,
    lead: float,
    lag: float,
) -> int:
    """`flat_motion` of one record each."""
    flat_motion(bodies[0], paths[0], time_s, lead, lag, heading, stencils[0], state, wrench)
    return 0
