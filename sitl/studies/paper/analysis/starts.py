"""V.A: where the hovers start, and what settles from there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from controller.law.state import Array
from sitl.studies.paper import independent_simulation as second
from sitl.studies.paper.flights import Flight

BAND = 0.25
"""What V.A keeps x, y and z within, m."""


class Start(NamedTuple):
    """One of the initial conditions that the text could mean."""

    title: str
    overrides: tuple[str, ...]


STARTS = {
    "rest_length": Start("Table I, l = l₀ = 1 m at the start", ("initial.vehicle_position=[0, 0, 1]",)),
    "equilibrium": Start("at the equilibrium, l = 1.981 m", ()),
    "printed": Start(
        "at the printed x*, z_v = 2.5, z_p = 0.5 m",
        ("initial.vehicle_position=[0, 0, 2.5]", "initial.load_position=[0, 0, 0.5]"),
    ),
    "long_cable": Start(
        "l₀ = 10 m with z_v = 2.5, z_p = 0.5 m",
        (
            "cable.rest_length=10",
            "initial.vehicle_position=[0, 0, 2.5]",
            "initial.load_position=[0, 0, 0.5]",
        ),
    ),
}


def noisy_starts(quick: bool) -> dict[str, Start]:
    """The starts that fly under noise."""
    return {key: start for key, start in STARTS.items() if key == "equilibrium" or not quick}


def settling_heights(
    time: Array, vehicle: Array, load: Array, reference: Array, length: float
) -> dict[str, float]:
    """How the heights of load and vehicle (n, 3) m settle on the reference (n,) m; length of the cable, m."""
    deviation = np.abs(load[:, 2] - reference)
    stretch = np.abs(vehicle[:, 2] - load[:, 2] - length)
    late = time >= 5.0
    return {
        "largest_load_deviation_m": float(deviation.max()),
        "load_deviation_after_5_s_m": float(deviation[late].max()),
        "stretch_after_5_s_m": float(stretch[late].max()),
        "final_load_deviation_m": float(deviation[-1]),
    }


def largest_difference(flight: Flight, other: second.Run) -> float:
    """Largest distance between the two simulations along any axis, of vehicle and load, m."""
    n = len(other.time)
    return float(
        max(np.abs(flight.load[:n] - other.load).max(), np.abs(flight.vehicle[:n] - other.vehicle).max())
    )
