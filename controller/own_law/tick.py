"""The compiled parts of a tick with a law of one's own: the reference before it, the allocation after it."""

from __future__ import annotations

from typing import Any

import numpy as np

from controller.law.allocation import ALLOCATION, MOST_ROTORS, allocate
from controller.law.control_law import WORK
from controller.law.reference import DERIVATIVES, PATH, feasible, path_derivatives
from controller.law.state import WRENCH_SIZE, Array
from sitl_bridge.compiled import Buffer, entry_point

MOTION_ROWS = DERIVATIVES + 1


@entry_point(
    Buffer(PATH, (1,)),
    Buffer(np.float64, (MOTION_ROWS, 3)),
    Buffer(np.float64, (MOTION_ROWS, 3)),
    Buffer(np.float64, (MOTION_ROWS,)),
    float,
)
def reference_at(paths: Any, motion: Array, raw: Array, scratch: Array, time_s: float) -> int:
    """The reference at a time: row k of `motion` and of `raw` (6, 3) is its k-th derivative, m and s.

    motion: left smoothly from the start; raw: as it is set; scratch: (6,).
    """
    path = paths[0]
    feasible(path, time_s, motion, scratch)
    path_derivatives(path, time_s, raw)
    return 0


@entry_point(
    Buffer(ALLOCATION, (1,)),
    Buffer(WORK, (1,)),
    Buffer(np.float64, (WRENCH_SIZE,)),
    Buffer(np.float64, (MOST_ROTORS,)),
)
def allocate_wrench(allocations: Any, works: Any, wrench: Array, controls: Array) -> int:
    """Rotor commands (16,), 0..1, for a wrench (4,), N and N m; returns 1 when a rotor limit was met."""
    work = works[0]
    return 1 if allocate(allocations[0], wrench, controls, work.achieved, work.rotors) else 0
