"""Gates: whether an innovation is small enough for its measurement to be used, and the statistics of that."""

from __future__ import annotations

import math

from controller.estimator.correct.update import predicted_variance
from controller.estimator.records import (
    Filter,
)
from sitl_bridge.compiled import kernel


@kernel
def accept(f: Filter, sensor: int, ratio: float) -> bool:
    """Record a gate's verdict; ratio: innovation over gate, the largest of the axes (1 is the limit)."""
    m = f.m
    m.test_ratio[sensor] = ratio
    if ratio <= 1.0:
        m.rejected_in_row[sensor] = 0
        m.last_used[sensor] = m.time
        return True
    m.rejected[sensor] += 1
    m.rejected_in_row[sensor] += 1
    return False


@kernel
def record_nis(f: Filter, sensor: int, squares: float, degrees: int) -> None:
    """Add to the consistency statistics: normalised innovations squared and their degrees of freedom."""
    f.m.nis_sum[sensor] += squares
    f.m.nis_count[sensor] += degrees


NINETY_FIVE = 1.959964
"""Standard deviations within which 95 % of a normal distribution lie."""


GARBAGE = 1e6
"""Standard deviations beyond which, and for what is not a number, a sample is no measurement at all."""


@kernel
def gate_ratio(f: Filter, sensor: int, axis: int, innovation: float, variance: float) -> float:
    """Record an innovation of this variance; returns its size relative to the gate."""
    m = f.m
    normalised = innovation / math.sqrt(variance)
    if not abs(normalised) < GARBAGE:  # also where it is not a number
        innovation, normalised = 0.0, GARBAGE
    m.innovation[sensor, axis] = innovation
    m.normalised[sensor, axis] = normalised
    m.seen[sensor] += 1
    if abs(normalised) < NINETY_FIVE:
        m.within[sensor] += 1
    return float(abs(normalised) / f.p.gate[sensor])


@kernel
def row_ratio(f: Filter, sensor: int, axis: int, innovation: float, noise: float) -> float:
    """`gate_ratio` for the present row, which is cleared; noise: variance of the measurement itself."""
    return float(gate_ratio(f, sensor, axis, innovation, predicted_variance(f) + noise))
