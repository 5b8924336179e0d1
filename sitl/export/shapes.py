"""Sizes with which vehicle and load are drawn, where the description leaves them open."""

from __future__ import annotations

import math

from sitl_bridge.vehicle.description import Vehicle

LOAD_DENSITY = 300.0
"""kg/m³, of a load whose size is not told."""
SMALLEST_LOAD = 0.05
"""m, radius with which a load is drawn at least."""


def load_radius(vehicle: Vehicle) -> float:
    """Of the load as a ball, m: as described, else by its mass."""
    by_mass = (3.0 * vehicle.load.mass / (4.0 * math.pi * LOAD_DENSITY)) ** (1.0 / 3.0)
    return max(vehicle.load.radius or by_mass, SMALLEST_LOAD)


def disc_diameter(vehicle: Vehicle, rotor: int) -> float:
    """Of a rotor, m: as described, else such that neighbours of a quadrotor do not touch."""
    x, y, _ = vehicle.rotors[rotor].position
    return vehicle.rotors[rotor].diameter or 0.9 * math.hypot(x, y)
