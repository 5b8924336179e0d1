"""The cable's length along a planned motion: behind its tension by c/k, which fast motions notice.

scipy is imported where it is called: a flight whose motion is kept (`kept`) does without.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from controller.law.reference import MOST_PIECES, OTHER_LAGS, PIECE_ORDER
from controller.law.state import Array
from sitl_bridge.vehicle.description import Cable

_DEGREE = PIECE_ORDER - 1
_KNOTS = np.concatenate([np.zeros(_DEGREE), np.linspace(0.0, 1.0, MOST_PIECES + 1), np.ones(_DEGREE)])
SAMPLES = 32 * MOST_PIECES + 1
"""Times along the motion at which the tension is taken"""
SHORTEST_LAG = 1e-4
"""s; a shorter one is left out."""
_JOINED = 6
"""Value and derivatives that the length has in common with hover before the motion, and with what follows."""
_FASTEST_DECAY = 6.0
"""Pieces of the motion over the lag; a faster decay behind the motion is over at once."""


def cable_lag(cable: Cable) -> float:
    """Time constant, s, of the cable's length behind its tension; 0: it follows at once."""
    lag = cable.damping / cable.stiffness
    return lag if lag >= SHORTEST_LAG else 0.0


def planned_lengths(tension: Array, duration: float, cable: Cable, first: float | None = None) -> Array:
    """Lengths, m, as pieces (3, MOST_PIECES, 8) over equal shares of the duration (s), in rising powers.

    They are for cables with `OTHER_LAGS` times the lag.

    tension: (SAMPLES,), N, evenly spaced; at both ends it has been constant, and remains so. The length is
    the solution of F = k (l - l0) + c l', as a spline that begins at rest and ends in the decay that follows.
    first: the length with which it begins, m, if that is not at rest.
    """
    steady = cable.rest_length + tension / cable.stiffness
    lag = cable.damping / cable.stiffness
    return np.array([_lagging_pieces(steady, duration, lag * other, first) for other in OTHER_LAGS])


def _lagging_pieces(steady: Array, duration: float, lag: float, first: float | None) -> Array:
    """Pieces (MOST_PIECES, 8) of what follows steady (SAMPLES,) with a lag, s."""
    from scipy.interpolate import BSpline, PPoly

    length = lagging(steady, duration / (SAMPLES - 1), lag, first)
    columns, at_end = _columns()
    coefficients = np.zeros(columns.shape[1])
    joined = _JOINED if first is None else 1
    coefficients[:joined] = length[0]
    rate = duration / lag
    rest = length[-1] - steady[-1] if rate < _FASTEST_DECAY * MOST_PIECES else 0.0
    decay = rest * (-rate) ** np.arange(float(_JOINED))
    coefficients[-_JOINED:] = steady[-1] + np.linalg.solve(at_end, decay)
    free = slice(joined, len(coefficients) - _JOINED)
    found, *_ = np.linalg.lstsq(columns[:, free], length - columns @ coefficients, rcond=None)
    coefficients[free] = found
    pieces = PPoly.from_spline(BSpline(_KNOTS, coefficients, _DEGREE)).c[::-1, _DEGREE:-_DEGREE].T
    return np.asarray(pieces * MOST_PIECES ** -np.arange(float(PIECE_ORDER)))


def lagging(steady: Array, spacing: float, lag: float, first: float | None = None) -> Array:
    """What follows steady (n, …) with a lag, s: exact for what is linear between the samples.

    first: with what it begins, if that is not the first of steady.
    """
    if lag <= 0.0:
        return steady
    decay = math.exp(-spacing / lag)
    share = lag / spacing * (1.0 - decay)
    driven = (share - decay) * steady[:-1] + (1.0 - share) * steady[1:]
    powers = decay ** np.arange(float(len(steady)))
    order = np.arange(len(steady))
    past = np.tril(powers[np.abs(order[:, None] - order)])
    begun = steady[:1] if first is None else np.full_like(steady[:1], first)
    return np.asarray(past @ np.concatenate([begun, driven]))


@lru_cache(maxsize=1)
def _columns() -> tuple[Array, Array]:
    """The spline at the samples for each coefficient, and at the end its derivatives for the last ones."""
    from scipy.interpolate import BSpline

    times = np.linspace(0.0, 1.0, SAMPLES)
    count = len(_KNOTS) - _DEGREE - 1
    spline = BSpline(_KNOTS, np.eye(count), _DEGREE)
    ends = [spline.derivative(order)(1.0) if order else spline(1.0) for order in range(_JOINED)]
    return np.asarray(spline(times)), np.array(ends)[:, -_JOINED:]
