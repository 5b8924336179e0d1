"""Gains against python-control, quadrature and a Riccati equation of the whole delayed loop."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg

from controller.design.catalogue import default_weights, paper_lqr_weights, paper_weights
from controller.design.lqr import (
    SampledGain,
    SampledModel,
    Weights,
    continuous_gain,
    sampled_gain,
    sampled_model,
)
from controller.design.model import LinearModel, linear_model, with_integrator, with_rotor_lag
from controller.law.state import Array
from sitl_bridge.vehicle.description import Vehicle
from tests.controller.fleet import FLEET

PAPER = FLEET["paper"]
OSCILLATOR = LinearModel(
    np.array([[0.0, 1.0, 0.0], [-4.0, -0.3, 1.0], [0.0, 0.0, -2.0]]),
    np.array([[0.0, 0.1], [0.0, 1.0], [2.0, 0.0]]),
)
OSCILLATOR_WEIGHTS = Weights(np.diag([3.0, 0.5, 0.1]), np.diag([0.2, 1.5]))


def integral_model(vehicle: Vehicle) -> LinearModel:
    return with_integrator(linear_model(vehicle))


def test_continuous_gain_against_python_control() -> None:
    import control

    for model, weights in (
        (linear_model(PAPER), paper_lqr_weights()),
        (integral_model(PAPER), paper_weights()),
        (integral_model(FLEET["paper, 10 m"]), paper_weights()),
        (OSCILLATOR, OSCILLATOR_WEIGHTS),
    ):
        expected, riccati, _ = control.lqr(model.A, model.B, weights.Q, weights.R)
        gain = continuous_gain(model, weights)
        np.testing.assert_allclose(gain, expected, rtol=1e-6, atol=1e-6 * np.abs(gain).max())
        # And the Riccati equation holds for the P that this gain belongs to, by its closed loop's cost.
        closed = model.A - model.B @ gain
        cost = linalg.solve_continuous_lyapunov(closed.T, -(weights.Q + gain.T @ weights.R @ gain))
        np.testing.assert_allclose(cost, riccati, rtol=1e-5, atol=1e-6 * np.abs(cost).max())


def quadrature(model: LinearModel, weights: Weights, period: float, pieces: int = 200) -> SampledModel:
    """Discretised model and cost by Gauss-Legendre quadrature over short pieces, nothing doubled."""
    n, m = model.B.shape
    dynamics = np.zeros((n + m, n + m))
    dynamics[:n, :n], dynamics[:n, n:] = model.A, model.B
    nodes, node_weights = np.polynomial.legendre.leggauss(6)
    step = period / pieces
    within = [linalg.expm(dynamics * step * (1.0 + node) / 2.0) for node in nodes]
    whole = linalg.expm(dynamics * step)
    both = linalg.block_diag(weights.Q, weights.R)
    transition, cost = np.eye(n + m), np.zeros((n + m, n + m))
    for _ in range(pieces):
        for node, weight in zip(within, node_weights, strict=True):
            here = node @ transition
            cost += weight * step / 2.0 * here.T @ both @ here
        transition = whole @ transition
    return SampledModel(transition[:n, :n], transition[:n, n:], cost[:n, :n], cost[:n, n:], cost[n:, n:])


@pytest.mark.parametrize("period", [0.002, 0.02, 0.5])
@pytest.mark.parametrize(
    ("model", "weights"),
    [
        (OSCILLATOR, OSCILLATOR_WEIGHTS),
        (integral_model(PAPER), paper_weights()),
        (with_rotor_lag(linear_model(FLEET["small"]), 0.02), Weights(np.eye(22), np.eye(4))),
    ],
    ids=["oscillator", "paper", "lag"],
)
def test_sampled_model_against_quadrature(model: LinearModel, weights: Weights, period: float) -> None:
    found, expected = sampled_model(model, weights, period), quadrature(model, weights, period)
    for name, got, want in zip(found._fields, found, expected, strict=True):
        np.testing.assert_allclose(got, want, rtol=1e-9, atol=1e-11 * np.abs(want).max(), err_msg=name)


def augmented_gain(sampled: SampledModel, delay: int) -> Array:
    """The optimal gain (m, n + delay·m) of the loop with its commands under way as states, newest first."""
    n, m = sampled.B.shape
    size = n + delay * m
    a, b = np.zeros((size, size)), np.zeros((size, m))
    a[:n, :n] = sampled.A
    a[:n, size - m :] = sampled.B  # the oldest command acts now
    b[n : n + m] = np.eye(m)
    for age in range(1, delay):
        a[n + age * m : n + (age + 1) * m, n + (age - 1) * m : n + age * m] = np.eye(m)
    q = np.zeros((size, size))
    q[:n, :n], q[:n, size - m :], q[size - m :, :n] = sampled.Q, sampled.N, sampled.N.T
    q[size - m :, size - m :] = sampled.R
    riccati = linalg.solve_discrete_are(a, b, q, 1e-12 * np.eye(m))  # what is commanded now costs later
    return np.asarray(np.linalg.solve(b.T @ riccati @ b + 1e-12 * np.eye(m), b.T @ riccati @ a))


@pytest.mark.parametrize("delay", [1, 2, 4])
def test_delayed_gain_against_the_riccati_equation_of_the_whole_loop(delay: int) -> None:
    sampled = sampled_model(OSCILLATOR, OSCILLATOR_WEIGHTS, 0.05)
    gain = sampled_gain(sampled, delay)
    expected = augmented_gain(sampled, delay)
    found = np.hstack([gain.state, *gain.past])
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-8)


def delayed_loop(sampled: SampledModel, gain: SampledGain | Array, delay: int) -> Array:
    """Closed-loop matrix of [x, commands under way]; a bare K knows nothing of the delay."""
    n, m = sampled.B.shape
    size = n + delay * m
    command = np.zeros((m, size))
    if isinstance(gain, SampledGain):
        command[:, :n] = -gain.state
        for age, past in enumerate(gain.past):
            command[:, n + age * m : n + (age + 1) * m] = -past
    else:
        command[:, :n] = -gain
    matrix = np.zeros((size, size))
    matrix[:n, :n] = sampled.A
    if delay == 0:
        return matrix + sampled.B @ command
    matrix[:n, size - m :] = sampled.B
    matrix[n : n + m] = command
    matrix[n + m :, n : size - m] += np.eye(size - n - m)
    return matrix


def radius(matrix: Array) -> float:
    return float(np.abs(np.linalg.eigvals(matrix)).max())


@pytest.mark.parametrize(
    ("rate_hz", "delay", "expected", "digits"),
    [(250, 0, 3.1, 0.05), (500, 0, 1.02, 0.005), (1000, 1, 1.009, 5e-4)],
)
def test_the_papers_gains_cannot_be_run_by_a_computer(
    rate_hz: float, delay: int, expected: float, digits: float
) -> None:
    """Spectral radii beyond 1 at rates that a computer manages (docs/paper.md)."""
    model, weights = integral_model(PAPER), paper_weights()
    sampled = sampled_model(model, weights, 1.0 / rate_hz)
    assert radius(delayed_loop(sampled, continuous_gain(model, weights), delay)) == pytest.approx(
        expected, abs=digits
    )


@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("rate_hz", [50, 100, 250, 500, 1000])
def test_the_sampled_design_keeps_the_papers_slow_poles(rate_hz: float, delay: int) -> None:
    model, weights = integral_model(FLEET["paper, 10 m"]), paper_weights()
    period = 1.0 / rate_hz
    slow = [
        s
        for s in np.linalg.eigvals(model.A - model.B @ continuous_gain(model, weights))
        if abs(s) < 6.0  # rad/s
    ]
    assert len(slow) >= 12
    sampled = sampled_model(model, weights, period)
    matrix = delayed_loop(sampled, sampled_gain(sampled, delay), delay)
    assert radius(matrix) < 1.0
    poles = np.linalg.eigvals(matrix)
    poles = np.log(poles[np.abs(poles) > 1e-6].astype(complex)) / period
    for s in slow:
        assert np.min(np.abs(poles - s)) < 0.05 * abs(s), f"{s} is lost"


def test_default_gain_is_optimal() -> None:
    """Every other gain nearby costs more: the cost from random states, by its Lyapunov equation."""
    vehicle = FLEET["small"]
    sampled = sampled_model(integral_model(vehicle), default_weights(vehicle), 0.004)
    best = sampled_gain(sampled).state

    def cost(gain: Array) -> Array:
        closed = sampled.A - sampled.B @ gain
        stage = sampled.Q - sampled.N @ gain - gain.T @ sampled.N.T + gain.T @ sampled.R @ gain
        return np.asarray(linalg.solve_discrete_lyapunov(closed.T, stage))

    optimum = cost(best)
    rng = np.random.default_rng(1)
    for _ in range(5):
        other = cost(best * (1.0 + 0.01 * rng.standard_normal(best.shape)))
        states = rng.standard_normal((20, len(optimum)))
        assert np.all(np.einsum("ki,ij,kj->k", states, other - optimum, states) > 0.0)
