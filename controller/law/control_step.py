"""One control step, compiled: reference -> estimate -> law -> rotor commands -> memory."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from controller.law.adaptation import adapt, give, set_pace
from controller.law.allocation import ALLOCATION, MOST_ROTORS, allocate
from controller.law.approach import advance
from controller.law.control_law import DESIGN, MEMORY, WORK, remember, step
from controller.law.geometric import geometric_step
from controller.law.reference import PATH
from controller.law.state import STATE_SIZE, Array
from sitl_bridge.compiled import Buffer, entry_point, kernel

LAW_BUFFERS = (
    Buffer(DESIGN, (1,)),
    Buffer(ALLOCATION, (1,)),
    Buffer(PATH, (1,)),
    Buffer(MEMORY, (1,)),
    Buffer(WORK, (1,)),
)
"""The array arguments of `control_step` in front of estimate and controls: a `Law`."""


@kernel
def law_step(design: Any, memory: Any, path: Any, estimate: Array, work: Any) -> None:
    """The step of the law that a design is for: work.wrench = u."""
    if design.geometric:
        geometric_step(design, memory, path, estimate, work)
    else:
        step(design, memory, path, estimate, work)


@entry_point(*LAW_BUFFERS, Buffer(np.float64, (STATE_SIZE,)), Buffer(np.float64, (MOST_ROTORS,)))
def control_step(
    designs: Any, allocations: Any, paths: Any, memories: Any, works: Any, estimate: Array, controls: Array
) -> int:
    """Rotor commands (16,), 0..1, for an estimate (18,), eq. 31; returns 1 when a rotor limit was met.

    A law that has lost itself (a wrench that is not finite) stops the rotors openly: the commands are NaN.
    """
    design, path, memory, work = designs[0], paths[0], memories[0], works[0]
    if path.guide.active:
        advance(path, memory.ticks * design.period)
    if design.adapts:
        adapt(design, memory, estimate)
        set_pace(design, memory, path)
    law_step(design, memory, path, estimate, work)
    limited = allocate(allocations[0], work.wrench, controls, work.achieved, work.rotors)
    if not math.isfinite(work.wrench[0] + work.wrench[1] + work.wrench[2] + work.wrench[3]):
        for i in range(MOST_ROTORS):
            controls[i] = math.nan
        return 1
    remember(design, memory, work)
    if design.adapts:
        give(design, memory, work.achieved[0])
    return 1 if limited else 0
