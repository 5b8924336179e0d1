"""How near a load can be held against white force by a linear law that bears a delay: the H2 optimum.

The law that minimises the load's variance at a given effort is the LQ law of that cost. The cheaper the
effort, the nearer the load is held, and the less delay the loop bears. So the price at which the margin is
just what is promised gives the nearest that this family reaches.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import linalg

from controller.design.catalogue import Emphasis, default_weights, design_for
from controller.design.lqr import Weights
from controller.design.margins import closed_loop_matrix, delay_margin
from controller.design.model import actuated_model
from controller.law.control_law import FEEDFORWARD, Design
from controller.law.state import EULER_ANGLES, LOAD_POSITION, LOAD_VELOCITY, STATE_SIZE, Array
from sitl.studies.paper import offline
from sitl.studies.paper.analysis.hover_noise import FORCE_STD, HOLD_TIME
from sitl_bridge.vehicle.description import Vehicle

LEAST_PRICE = 1e-9
_HALVINGS = 12
_YAW_AND_INTEGRAL = 1e-3
"""Of the default weights: what the load's place does not depend on has to be stable, too."""


class Held(NamedTuple):
    """How near a law holds the load."""

    rms: float
    """m, of the distance"""
    margin: float
    """s, of the delay that it bears at the input that bears least"""


def load_rms(vehicle: Vehicle, record: Design) -> float:
    """Stationary rms of the load's distance, m, in the linear loop, under V.A's noise as white force."""
    model = actuated_model(vehicle)
    matrix, n, period = closed_loop_matrix(model, record), len(model.A), float(record["period"][0])
    force = np.zeros((n, 3))
    force[LOAD_VELOCITY] = np.eye(3) / vehicle.load.mass
    # Van Loan: the covariance that a white force adds over a period.
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[n:, n:] = -model.A, model.A.T
    block[:n, n:] = FORCE_STD**2 * HOLD_TIME * force @ force.T
    exponential = linalg.expm(block * period)
    added = np.zeros_like(matrix)
    added[:n, :n] = exponential[n:, n:].T @ exponential[:n, n:]
    covariance = linalg.solve_discrete_lyapunov(matrix, added)
    return math.sqrt(float(np.trace(covariance[LOAD_POSITION, LOAD_POSITION])))


def optimal(vehicle: Vehicle, price: float) -> Held:
    """The law that holds the load nearest at a price of effort, over that of the default weights."""
    weights = default_weights(vehicle, Emphasis(integral=_YAW_AND_INTEGRAL))
    kept: Array = np.zeros(STATE_SIZE + 3)
    kept[LOAD_POSITION] = kept[EULER_ANGLES.stop - 1] = kept[STATE_SIZE:] = 1.0
    record = design_for(vehicle, offline.RATE_HZ, Weights(weights.Q * kept, weights.R * price), FEEDFORWARD)
    model = actuated_model(vehicle)
    margin = min(delay_margin(model, record, (one,)) for one in range(4))
    return Held(load_rms(vehicle, record), margin)


def nearest(vehicle: Vehicle, margin: float) -> Held:
    """The optimal law with the least price that still bears a delay of `margin` (s) at each input."""
    low, high = math.log(LEAST_PRICE), 0.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if optimal(vehicle, math.exp(middle)).margin >= margin else (middle, high)
    return optimal(vehicle, math.exp(high))
