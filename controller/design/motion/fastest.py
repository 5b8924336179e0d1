"""The fastest motion from rest to rest along a straight line, within limits.

The share of the way is a spline of degree 7 over equal pieces, at rest to the sixth derivative at both ends,
so that moments begin and end without a jump. Its unknowns are the coefficients of its acceleration and the
duration. Sequential linear programming finds them: the limits are linearised along the motion so far, and the
shortest motion is sought not far from it. What it finds is stretched until it keeps every limit; so any
outcome is feasible, and the smooth step that it begins with is the slowest one.

scipy is imported where it is called: a flight whose motion is kept (`kept`) does without.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from controller.design.motion.straight_line import ORDERS, StraightLine
from controller.law.reference import MOST_PIECES, PIECE_ORDER, SMOOTH_STEP
from controller.law.state import Array

DEGREE = PIECE_ORDER - 1
_SAMPLES = 4 * MOST_PIECES + 1
"""Times at which the limits are kept while the motion is sought"""
_CHECKED = 16 * MOST_PIECES + 1
"""and in the end."""
_STEPS = 14
_REACH = 0.3
"""Of g: how far the acceleration's coefficients may go in one step."""
_LEAST_REACH = 0.005
_STRETCH = 0.06
"""How far the duration may change in one step, of itself."""
_PRICE = 5.0
"""Of the largest excess, in shares of the duration: more than can be gained by it."""
_MERIT = 0.2
_LEAST_GAIN, _GOOD_GAIN = 0.1, 0.7
"""Of what the linearisation promises: with less, the step was too far; with more, the next may go further."""
_TO_BE_STRETCHED = 0.1
"""Largest excess of a motion that is worth being stretched."""
_NEAR = -0.6
"""Excess from which on a limit counts in a step; further ones are not reached."""
_ENOUGH = 1e-3
"""Change of the duration, of itself, that ends the search."""
_BACKWARDS = 0.02
"""Of the mean speed: so fast may the load go the wrong way."""
_LONGEST = 600.0
"""s; nothing that hovers needs more."""


class Profile(NamedTuple):
    """A motion along a line."""

    duration: float
    """s"""
    pieces: Array
    """(n, 8): share of the way in each of n equal shares of the duration, in rising powers of its share"""
    shares: Array
    """(5, n): share of the way, and its derivatives by the share of the duration, evenly spaced"""


class _Basis(NamedTuple):
    """The spline for each coefficient of its acceleration (all over a duration of 1)."""

    derivatives: Array
    """(5, n, m) at n times"""
    ends: Array
    """(2, m): speed and place at the end"""
    pieces: Array
    """(pieces, 8, m)"""


@lru_cache(maxsize=4)
def _basis(samples: int) -> _Basis:
    from scipy.interpolate import BSpline, PPoly

    inner = MOST_PIECES - 5
    knots = np.concatenate([np.zeros(5), np.linspace(0.0, 1.0, MOST_PIECES + 1), np.ones(5)])
    times = np.linspace(0.0, 1.0, samples)
    derivatives, ends = np.zeros((ORDERS + 1, samples, inner)), np.zeros((2, inner))
    pieces = np.zeros((MOST_PIECES, PIECE_ORDER, inner))
    scale = MOST_PIECES ** -np.arange(float(PIECE_ORDER))
    for k in range(inner):
        # The first and the last five coefficients are zero: a clamped end, at rest.
        acceleration = BSpline(knots, np.eye(inner + 10)[5 + k], DEGREE - 2)
        place = acceleration.antiderivative(2)
        for order in range(ORDERS + 1):
            derivatives[order, :, k] = place.derivative(order)(times) if order else place(times)
        ends[:, k] = derivatives[1, -1, k], derivatives[0, -1, k]
        polynomials = PPoly.from_spline(place)
        pieces[:, :, k] = polynomials.c[::-1, DEGREE:-DEGREE].T * scale
    return _Basis(derivatives, ends, pieces)


def fastest(line: StraightLine, shortest: float) -> Profile:
    """The fastest motion along a line, lasting no less than `shortest` (s).

    The same arguments give the same motion.
    """
    search = _Search(line)
    coefficients = search.smooth_step()
    duration = search.feasible_duration(coefficients, shortest, _SAMPLES)
    best, best_duration, cost, reach = coefficients, duration, duration, _REACH
    for _ in range(_STEPS):
        if best_duration <= shortest or reach < _LEAST_REACH:
            break
        step = search.step(coefficients, duration, reach * line.gravity, shortest)
        if step is None:
            reach *= 0.4
            continue
        excess = search.largest_excess(step.coefficients, step.duration)
        found_cost = step.duration * (1.0 + _MERIT * excess)
        gain = (cost - found_cost) / max(cost - step.cost, 1e-9)
        if gain < _LEAST_GAIN:
            reach *= 0.4
            continue
        if gain > _GOOD_GAIN:
            reach *= 2.0
        done = cost - found_cost < _ENOUGH * cost
        coefficients, duration, cost = step.coefficients, step.duration, found_cost
        if excess < _TO_BE_STRETCHED:
            found = search.feasible_duration(coefficients, shortest, _SAMPLES, duration)
            if found < best_duration:
                best, best_duration = coefficients, found
        if done:
            break
    duration = search.feasible_duration(best, shortest, _CHECKED, best_duration)
    basis = _basis(_SAMPLES)
    return Profile(duration, basis.pieces @ best, basis.derivatives @ best)


class _Step(NamedTuple):
    coefficients: Array
    duration: float
    """s"""
    cost: float
    """Duration with the price of the excess that is left, by the linearisation, s"""


class _Search:
    def __init__(self, line: StraightLine) -> None:
        self._line = line

    def smooth_step(self) -> Array:
        """Coefficients (m,) of the spline that comes nearest to the smooth step."""
        basis = _basis(_SAMPLES)
        smooth = np.polynomial.Polynomial(SMOOTH_STEP).deriv(2)(np.linspace(0.0, 1.0, _SAMPLES))
        columns, ends = basis.derivatives[2], basis.ends
        system = np.block([[columns.T @ columns, ends.T], [ends, np.zeros((2, 2))]])
        return np.asarray(np.linalg.solve(system, [*(columns.T @ smooth), 0.0, 1.0])[: columns.shape[1]])

    def feasible_duration(
        self, coefficients: Array, shortest: float, samples: int, guess: float = 0.0
    ) -> float:
        """The shortest duration, s, to a thousandth, in which the motion keeps every limit."""
        shares = _basis(samples).derivatives @ coefficients
        if float(shares[1].min()) < -_BACKWARDS:
            return 2.0 * _LONGEST

        def kept(duration: float) -> bool:
            return float(self._line.excess(shares, duration).max()) <= 1e-9

        if kept(shortest):
            return shortest
        low, high, factor = shortest, max(guess, 1.02 * shortest), 1.01 if guess else 1.5
        while not kept(high) and high < _LONGEST:
            low, high, factor = high, high * factor, factor * factor
        if low == shortest and guess:  # the guess was long enough
            factor = 1.01
            while high / factor > shortest and kept(high / factor):
                high, factor = high / factor, factor * factor
            low = max(shortest, high / factor)
        while high > low * (1.0 + 5e-4):
            middle = (low * high) ** 0.5
            low, high = (low, middle) if kept(middle) else (middle, high)
        return high

    def largest_excess(self, coefficients: Array, duration: float) -> float:
        """Of any limit at any time; 0: all are kept."""
        shares = _basis(_SAMPLES).derivatives @ coefficients
        return max(0.0, float(self._line.excess(shares, duration).max()))

    def step(self, coefficients: Array, duration: float, reach: float, shortest: float) -> _Step | None:
        """The fastest motion, by the limits' linearisation, within reach (m/s²); None: there is none."""
        from scipy.optimize import linprog

        basis = _basis(_SAMPLES)
        unit = duration**2 / self._line.distance  # of a coefficient, for 1 m/s² of acceleration
        count = len(coefficients)
        shares = basis.derivatives @ coefficients
        excess, along, longer = self._line.linearised(shares, basis.derivatives, duration)
        near = excess > _NEAR
        forwards = np.zeros((_SAMPLES, count + 2))
        forwards[:, :count] = -basis.derivatives[1] * unit
        limits = np.zeros((int(near.sum()), count + 2))
        limits[:, :count] = along[near] * unit
        limits[:, count] = longer[near] * duration  # its change in shares of itself
        limits[:, count + 1] = -1.0  # the largest excess
        found = linprog(
            np.array([*np.zeros(count), 1.0, _PRICE]),
            A_ub=np.concatenate([limits, forwards]),
            b_ub=np.concatenate([-excess[near], shares[1]]),
            A_eq=np.hstack([basis.ends * unit, np.zeros((2, 2))]),
            b_eq=np.array([0.0, 1.0]) - basis.ends @ coefficients,
            bounds=[
                *[(-reach, reach)] * count,
                (max(-_STRETCH, shortest / duration - 1.0), _STRETCH),
                (0, None),
            ],
            method="highs",
        )
        if found.x is None:
            return None
        longer_by, left = found.x[count:].tolist()
        return _Step(
            coefficients + unit * found.x[:count],
            duration * (1.0 + longer_by),
            duration * (1.0 + longer_by + _MERIT * left),
        )
