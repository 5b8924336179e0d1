"""The optimal gains a second time, without a Riccati solver: from the eigenvectors of the Hamiltonian.

An LQR's closed loop has the stable half of the Hamiltonian's eigenvalues; the eigenvectors that belong to
them, [X; P X], give the cost matrix P and with it the gain. `design.lqr` solves the Riccati equation
(scipy, by a QZ decomposition of an extended pencil) and never sees these eigenvectors.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from controller.design.lqr import SampledModel, Weights
from controller.design.model import LinearModel

Array = NDArray[np.float64]


class Optimum(NamedTuple):
    """What minimises a quadratic cost."""

    gain: Array
    """K (m, n) of u = -K x"""
    poles: NDArray[np.complex128]
    """(n,) of the closed loop; continuous: 1/s, sampled: within the unit circle"""


def continuous(model: LinearModel, weights: Weights) -> Optimum:
    """In continuous time: eigenvalues of [[A, -B R⁻¹ B'], [-Q, -A']] with a negative real part."""
    on_inputs = np.linalg.solve(weights.R, model.B.T)
    values, vectors = np.linalg.eig(np.block([[model.A, -model.B @ on_inputs], [-weights.Q, -model.A.T]]))
    return Optimum(on_inputs @ _cost(values.real < 0.0, vectors), values[values.real < 0.0])


def sampled(model: SampledModel) -> Optimum:
    """In sampled time: generalised eigenvalues within the unit circle of the symplectic pencil.

    The cost's mixed term N is taken out first by u = w - R⁻¹ N' x.
    """
    n = len(model.A)
    mixed = np.linalg.solve(model.R, model.N.T)
    a, q = model.A - model.B @ mixed, model.Q - model.N @ mixed
    one, none = np.eye(n), np.zeros((n, n))
    left = np.block([[a, none], [-q, one]])
    right = np.block([[one, model.B @ np.linalg.solve(model.R, model.B.T)], [none, a.T]])
    values, vectors = linalg.eig(left, right)
    stable = np.abs(values) < 1.0
    cost = _cost(stable, vectors)
    on_inputs = model.R + model.B.T @ cost @ model.B
    return Optimum(np.linalg.solve(on_inputs, model.B.T @ cost @ a) + mixed, values[stable])


def _cost(stable: NDArray[np.bool_], vectors: NDArray[np.complex128]) -> Array:
    """P, from the eigenvectors [X; P X] of the stable half."""
    n = len(vectors) // 2
    if np.count_nonzero(stable) != n:
        raise ValueError("the Hamiltonian has eigenvalues on the boundary: there is no optimum")
    chosen = vectors[:, stable]
    return np.asarray(np.linalg.solve(chosen[:n].T, chosen[n:].T).T.real)
