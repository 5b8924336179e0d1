"""How errors grow under gains that were designed for another cable."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from controller.design.catalogue import paper_weights
from controller.design.lqr import sampled_gain, sampled_model
from controller.design.model import LinearModel, linear_model, with_integrator
from controller.law.state import Array
from sitl.studies.paper import independent_simulation as second
from sitl.studies.paper import riccati
from sitl.studies.paper.analysis.linear_model import hover_point
from sitl.studies.paper.analysis.sampled_loop import held, spectral_radius
from sitl.studies.paper.analysis.stiffness import (
    RATE_HZ,
)
from sitl_bridge.vehicle.description import Vehicle


def crossed_growths_again(vehicles: Sequence[Vehicle]) -> Array:
    """The same from the second simulation's Jacobians, and gains without a Riccati solver."""
    models = [
        with_integrator(LinearModel(*second.jacobians(v, hover_point(v), hover_wrench(v)))) for v in vehicles
    ]
    period = 1.0 / RATE_HZ
    made = [riccati.sampled(sampled_model(model, paper_weights(), period)).gain for model in models]
    loops = [held(model, period) for model in models]
    radii = [[np.abs(np.linalg.eigvals(a - b @ gain)).max() for a, b in loops] for gain in made]
    return np.asarray(np.log(np.array(radii)) * RATE_HZ)


def hover_wrench(vehicle: Vehicle) -> second.Wrench:
    """u* of a vehicle."""
    return vehicle.hover_thrust, 0.0, 0.0, 0.0


def crossed_growths(vehicles: Sequence[Vehicle]) -> Array:
    """Growth rates (designed for, flown on), 1/s, of the sampled loops; below 0: stable."""
    models = [with_integrator(linear_model(vehicle)) for vehicle in vehicles]
    made = [sampled_gain(sampled_model(model, paper_weights(), 1.0 / RATE_HZ)) for model in models]
    radii = [[spectral_radius(model, gain, 1.0 / RATE_HZ, 0) for model in models] for gain in made]
    return np.asarray(np.log(np.array(radii)) * RATE_HZ)
