"""Gain design: the paper's continuous LQR, and the same cost minimised for the loop that exists.

A computer holds the inputs between samples, and its commands take effect late. `sampled_gain` minimises the
continuous quadratic cost exactly for that loop: zero-order hold with the cost integrated between the samples
(Van Loan 1978), and a prediction over the loop's delay.

scipy is imported where it is called: a flight whose gains are kept (`kept`) does without.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controller.design.model import LinearModel
from controller.law.state import Array


class Weights(NamedTuple):
    """Q and R of the quadratic cost, eq. 53: the integral of x'Qx + u'Ru."""

    Q: Array
    R: Array


class SampledModel(NamedTuple):
    """x[k+1] = A x[k] + B u[k], and the cost of one period, [x; u]' [[Q, N], [N', R]] [x; u]."""

    A: Array
    B: Array
    Q: Array
    N: Array
    R: Array


class SampledGain(NamedTuple):
    """u[k] = -state·x[k] - sum over i of past[i]·u[k-1-i]."""

    state: Array
    """(m, n)"""
    past: Array
    """(delay, m, m), the newest past input first"""


def block_diagonal(*blocks: Array) -> Array:
    """Square matrices along the diagonal of one."""
    out = np.zeros((sum(map(len, blocks)),) * 2)
    at = 0
    for block in blocks:
        out[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    return out


def continuous_gain(model: LinearModel, weights: Weights) -> Array:
    """K (m, n) of u = -K x that minimises the cost in continuous time (the paper's design)."""
    from scipy import linalg

    riccati = linalg.solve_continuous_are(model.A, model.B, weights.Q, weights.R)
    return np.asarray(linalg.solve(weights.R, model.B.T @ riccati))


def sampled_model(model: LinearModel, weights: Weights, period: float) -> SampledModel:
    """Discretise model and cost exactly for inputs held over `period` seconds (Van Loan 1978).

    exp([[-F', W], [0, F]] h) = [[*, G], [0, E]] with F = [[A, B], [0, 0]] and W = blkdiag(Q, R) gives the
    transition E = [[A_d, B_d], [0, I]] and the cost of one period E'G.
    """
    from scipy import linalg

    n, m = model.B.shape
    size = n + m
    dynamics = np.zeros((size, size))
    dynamics[:n, :n], dynamics[:n, n:] = model.A, model.B
    # exp(-F' h) grows as fast as the model's fastest decay; short pieces, doubled, keep every digit.
    pieces = max(0, math.ceil(math.log2(max(1e-12, float(np.linalg.norm(dynamics, 2)) * period))))
    step = period / 2**pieces
    block = np.zeros((2 * size, 2 * size))
    block[:size, :size] = -dynamics.T
    block[:size, size:] = block_diagonal(weights.Q, weights.R)
    block[size:, size:] = dynamics
    exponential = linalg.expm(block * step)
    transition = exponential[size:, size:]
    cost = transition.T @ exponential[:size, size:]
    for _ in range(pieces):
        cost = cost + transition.T @ cost @ transition
        transition = transition @ transition
    cost = (cost + cost.T) / 2
    return SampledModel(transition[:n, :n], transition[:n, n:], cost[:n, :n], cost[:n, n:], cost[n:, n:])


def sampled_gain(sampled: SampledModel, delay: int = 0) -> SampledGain:
    """The gain that minimises the sampled cost when each command acts `delay` periods late.

    What happens before a command can act is settled, so the optimum is the delay-free gain applied to the
    state predicted `delay` periods ahead from the commands already under way.
    """
    from scipy import linalg

    a, b = sampled.A, sampled.B
    riccati = linalg.solve_discrete_are(a, b, sampled.Q, sampled.R, s=sampled.N)
    gain = np.linalg.solve(sampled.R + b.T @ riccati @ b, b.T @ riccati @ a + sampled.N.T)
    past = np.zeros((delay, b.shape[1], b.shape[1]))
    prediction = gain
    for age in range(delay):
        past[age] = prediction @ b
        prediction = prediction @ a
    return SampledGain(prediction, past)
