"""How far load and vehicle stray at hover under a force of noise on the load."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from controller.law.state import Array
from sitl.studies.paper.analysis.linear_model import gains
from sitl.studies.paper.flights import Flight
from sitl_bridge.vehicle.description import Vehicle

FORCE_STD = 5.0
"""Standard deviation of the white force on the load, N (docs/paper.md: the paper does not say)."""


HOLD_TIME = 0.01
"""s"""


def held_forces(flight: Flight) -> Array:
    """The force on the load in each hold time (n, 3), N, read off the log at the first tick in it."""
    count = round(float(flight.time[-1]) / HOLD_TIME)
    first = np.searchsorted(flight.time, np.arange(count) * HOLD_TIME - 1e-9)
    return np.asarray(flight.force_on_load[first])


def stationary_std(vehicle: Vehicle) -> Array:
    """Standard deviations (18,) of the state under the LQR, for a held white force of 1 N on the load."""
    gain, model = gains(vehicle, integral=False)
    closed = model.A - model.B @ gain
    force = np.zeros((18, 3))
    force[9:12] = np.eye(3) / vehicle.load.mass
    both = np.zeros((21, 21))
    both[:18, :18], both[:18, 18:] = closed, force
    held = linalg.expm(both * HOLD_TIME)
    covariance = linalg.solve_discrete_lyapunov(held[:18, :18], held[:18, 18:] @ held[:18, 18:].T)
    return np.asarray(np.sqrt(np.maximum(np.diag(covariance), 0.0)))


def std_under_white_force(vehicle: Vehicle) -> Array:
    """The same with a white force that is not held, of the held one's spectral density at low frequencies."""
    gain, model = gains(vehicle, integral=False)
    force = np.zeros((18, 3))
    force[9:12] = np.eye(3) / vehicle.load.mass
    covariance = linalg.solve_continuous_lyapunov(model.A - model.B @ gain, -HOLD_TIME * force @ force.T)
    return np.asarray(np.sqrt(np.maximum(np.diag(covariance), 0.0)))


def largest_deviations(load: Array, vehicle: Array) -> list[float]:
    """Largest of the load's deviations (n, 3) along x, y, z, and of the vehicle's along z, m."""
    return [*(float(v) for v in np.abs(load).max(axis=0)), float(np.abs(vehicle[:, 2]).max())]


def hover_position(flight: Flight) -> Array:
    """Where the vehicle hovers above the reference, (n, 3), m."""
    return np.asarray(flight.reference + np.array([0.0, 0.0, flight.vehicle_description.hover_length]))
