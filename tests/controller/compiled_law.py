"""A law without allocation, compiled: what it asks for is what the vehicle gets."""

from __future__ import annotations

from typing import Any

import numpy as np

from controller.law.control_law import DESIGN, MEMORY, WORK, remember
from controller.law.control_step import law_step
from controller.law.reference import PATH
from controller.law.state import STATE_SIZE, WRENCH_SIZE, Array
from sitl_bridge.compiled import Buffer, entry_point


@entry_point(
    Buffer(DESIGN, (1,)),
    Buffer(MEMORY, (1,)),
    Buffer(PATH, (1,)),
    Buffer(WORK, (1,)),
    Buffer(np.float64, (STATE_SIZE,)),
)
def given_step(designs: Any, memories: Any, paths: Any, works: Any, estimate: Array) -> int:
    """One step for an estimate (18,); the wrench is in the work record."""
    design, memory, work = designs[0], memories[0], works[0]
    law_step(design, memory, paths[0], estimate, work)
    for k in range(WRENCH_SIZE):
        work.achieved[k] = work.wrench[k]
    remember(design, memory, work)
    return 0
