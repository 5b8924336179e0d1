"""Gains by the size of the error: stiff ones near the reference, soft ones far from it.

Stiff gains hold the load against forces that nobody tells the law of. Far off they ask for more lean than
there is, and a law whose lean is at its limit swings the load up. So the gains go over to soft ones:

    K = K_soft + share (K - K_soft),   share = 1 for size <= near, 0 for size >= far, smooth between

The size is no less than the lean that the stiff law asks for: size² = e' P e, with P from the square of that
lean, summed up until the error has died away (Lyapunov). A size that went by the lean of the moment would be
small twice in every swing. The size of the reference's own motion is added, as if it were to stop: along a
fast motion the gains are the soft ones, which bear more delay.

The integral's own gain follows the soft law's stiffness of tilt, so that the lean it holds against a steady
force does not change with the share; how fast it is built up does.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from controller.law.state import LONGEST_DELAY, STATE_SIZE, WRENCH_SIZE, Array
from sitl_bridge.compiled import kernel

SIZED = 12
"""Deviations that count for the size: places and velocities."""

GAINS = np.dtype(
    [
        ("state_gain", "f8", (WRENCH_SIZE, STATE_SIZE)),
        ("lag_gain", "f8", (WRENCH_SIZE, WRENCH_SIZE)),  # on the wrench that lagging rotors give
        ("integral_gain", "f8", (WRENCH_SIZE, 3)),
        ("past_gain", "f8", (LONGEST_DELAY, WRENCH_SIZE, WRENCH_SIZE)),
        ("anti_windup", "f8", (3, WRENCH_SIZE)),
    ]
)

SOFT = np.dtype(
    [
        ("gains", GAINS),
        ("integral_rate", "f8", 3),  # with which the integral is built up, over that of the stiff law
        ("form", "f8", (SIZED, SIZED)),  # P, rad² over m² or (m/s)²; 0: the gains are always the stiff ones
        ("near", "f8"),  # rad
        ("far", "f8"),  # rad
    ]
)


@kernel
def _size(form: Any, deviation: Array) -> float:
    """The lean, rad, that the stiff law asks for at most for a deviation (18,)."""
    squared = 0.0
    for i in range(SIZED):
        row = 0.0
        for j in range(SIZED):
            row += form[i, j] * deviation[j]
        squared += row * deviation[i]
    return math.sqrt(max(0.0, squared))


@kernel
def _in_motion(work: Any) -> None:
    """work.moving (12,): how far the reference itself is from rest where its load is, towards its heading."""
    desired, moving, c, s = work.desired, work.moving, work.heading[0], work.heading[1]
    for i in range(0, SIZED, 3):
        east, north = desired[i], desired[i + 1]
        if i == 0:
            east, north = east - desired[3], north - desired[4]
        elif i == 3:
            east = north = 0.0
        moving[i], moving[i + 1] = c * east + s * north, c * north - s * east


@kernel
def stiff_share(soft: Any, work: Any) -> float:
    """The share of the stiff gains for work.deviation and the reference's motion."""
    _in_motion(work)
    size = float(_size(soft.form, work.deviation) + _size(soft.form, work.moving))
    if not size > soft.near:
        return 1.0
    if size >= soft.far:
        return 0.0
    x = (size - soft.near) / (soft.far - soft.near)
    return float(1.0 - x * x * (3.0 - 2.0 * x))


@kernel
def _between(soft: float, stiff: float, share: float) -> float:
    return stiff if share == 1.0 else soft + share * (stiff - soft)


@kernel
def schedule(design: Any, work: Any) -> None:
    """work.gains for work.deviation, and work.integral_rate."""
    soft, out = design.soft, work.gains
    share = stiff_share(soft, work) if soft.far > 0.0 else 1.0
    other = soft.gains
    for i in range(3):
        work.integral_rate[i] = _between(soft.integral_rate[i], 1.0, share)
    for k in range(WRENCH_SIZE):
        for i in range(STATE_SIZE):
            out.state_gain[k, i] = _between(other.state_gain[k, i], design.state_gain[k, i], share)
        for i in range(WRENCH_SIZE):
            out.lag_gain[k, i] = _between(other.lag_gain[k, i], design.lag_gain[k, i], share)
            for age in range(design.delay):
                out.past_gain[age, k, i] = _between(
                    other.past_gain[age, k, i], design.past_gain[age, k, i], share
                )
        for i in range(3):
            out.integral_gain[k, i] = _between(other.integral_gain[k, i], design.integral_gain[k, i], share)
            out.anti_windup[i, k] = _between(other.anti_windup[i, k], design.anti_windup[i, k], share)
