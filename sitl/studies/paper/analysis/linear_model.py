"""The linear model about hover: where it hovers, its modes without control, its gains."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from controller.design.catalogue import paper_lqr_weights, paper_weights
from controller.design.lqr import continuous_gain
from controller.design.model import LinearModel, linear_model, with_integrator
from controller.law.state import Array
from sitl.studies.paper import independent_simulation as second
from sitl.studies.paper.analysis.printed_model import PRINTED_LENGTH
from sitl_bridge.vehicle.description import Vehicle


def hover_point(vehicle: Vehicle, length: float | None = None) -> Array:
    """State (18,) of eq. 31 hovering with the load at the origin."""
    x = np.zeros(second.STATE_SIZE)
    x[2] = vehicle.hover_length if length is None else length
    return x


def lengths(vehicle: Vehicle) -> tuple[float, float]:
    """The lengths that the model is linearised at, m: the paper's, and the true equilibrium's."""
    return PRINTED_LENGTH, vehicle.hover_length


def open_loop_modes(vehicle: Vehicle) -> list[tuple[str, complex, int]]:
    """(meaning, pole with positive imaginary part, how many poles) of the open loop, by theory."""
    both = 1.0 / vehicle.airframe.mass + 1.0 / vehicle.load.mass
    cable = vehicle.cable
    string = cable.stiffness * (1.0 - cable.rest_length / vehicle.hover_length)
    decay = cable.damping * both / 2.0
    bounce = complex(-decay, 0.0) + np.emath.sqrt(decay**2 - cable.stiffness * both)
    return [
        ("bounce: vehicle and load against each other along the cable", complex(bounce), 2),
        (
            "pendulum, in x and in y: vehicle and load against each other sideways",
            1j * math.sqrt(string * both),
            4,
        ),
        ("drift of the common centre in x, y, z, and of roll, pitch, yaw", 0j, 12),
    ]


def gains(vehicle: Vehicle, integral: bool) -> tuple[Array, LinearModel]:
    """The paper's continuous gain for a vehicle, and the model that it closes the loop on."""
    model = linear_model(vehicle)
    if not integral:
        return continuous_gain(model, paper_lqr_weights()), model
    augmented = with_integrator(model)
    return continuous_gain(augmented, paper_weights()), augmented


def sorted_poles(poles: Any) -> list[complex]:
    """Poles from the fastest decay to the slowest."""
    return sorted((complex(p) for p in poles), key=lambda p: (round(p.real, 9), p.imag))


def damping_ratio(pole: complex) -> float:
    """-Re/|p|; 0 for a pole at the origin."""
    return -pole.real / abs(pole) + 0.0 if abs(pole) > 0 else 0.0


def complex_text(pole: complex) -> str:
    """A pole (or a pair) in words."""
    if abs(pole.imag) < 1e-9:
        return f"{pole.real:.4g}"
    real = f"{pole.real:.4g} " if abs(pole.real) > 1e-9 else ""
    return f"{real}± {abs(pole.imag):.4g}j"
