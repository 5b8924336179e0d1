"""How much more time a planned motion needs for a load or a cable other than described."""

from __future__ import annotations

import numpy as np

from controller.design.motion.limits import Limits
from controller.design.motion.straight_line import StraightLine
from controller.law.adaptation import FOUND
from controller.law.state import Array
from sitl_bridge.vehicle.description import Vehicle

_TRIED = ((-0.2, 0.2), (-0.25, 0.25), (-0.5, 0.5))
"""Deviations of load mass, stiffness and damping, over the description's, below and above."""
_LONGEST = 2.0
"""Over the plan."""
_TOLERANCE = 2e-3
_EXCEEDED = 2e-3
"""By so much a limit may be exceeded: the samples are those of the search, or others."""


def slower(vehicle: Vehicle, way: Array, limits: Limits, shares: Array, duration: float) -> Array:
    """(3, 2): share by which the motion is to last longer, over a deviation of load mass, stiffness, damping.

    The first is for less than described, the second for more. shares: (5, n), of the way (3,), m, evenly
    spaced in time over the duration, s.
    """
    out = np.zeros((FOUND, 2))
    for row, deviations in enumerate(_TRIED):
        for side, deviation in enumerate(deviations):
            line = StraightLine(_other(vehicle, row, 1.0 + deviation), way, limits)
            out[row, side] = (_needed(line, shares, duration) - 1.0) / abs(deviation)
    return out


def _needed(line: StraightLine, shares: Array, duration: float) -> float:
    """The shortest duration over the plan's, not below 1, that keeps the limits."""

    def kept(longer: float) -> bool:
        return float(line.excess(shares, longer * duration).max()) <= _EXCEEDED

    low, high = 1.0, _LONGEST
    if kept(low):
        return low
    while high > low * (1.0 + _TOLERANCE):
        middle = (low * high) ** 0.5
        low, high = (low, middle) if kept(middle) else (middle, high)
    return high


def _other(vehicle: Vehicle, row: int, factor: float) -> Vehicle:
    load, cable = vehicle.load, vehicle.cable
    if row == 0:
        return vehicle.model_copy(update={"load": load.model_copy(update={"mass": load.mass * factor})})
    name = ("stiffness", "damping")[row - 1]
    other = cable.model_copy(update={name: getattr(cable, name) * factor})
    return vehicle.model_copy(update={"cable": other})
