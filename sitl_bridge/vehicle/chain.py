"""A chain's figures: masses, places at rest, drag and fastest mode."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sitl_bridge.vehicle.description import Vehicle

MOST_SEGMENTS = 20


def end_mass(vehicle: Vehicle) -> float:
    """kg of a chain that move with the vehicle, and as much with the load: half a segment."""
    return 0.5 * vehicle.cable_mass / vehicle.cable.segments


def segment_drag(vehicle: Vehicle) -> float:
    """N s²/m² of one segment, across it."""
    return vehicle.cable.drag * vehicle.cable.rest_length / vehicle.cable.segments


def node_shares(vehicle: Vehicle) -> list[float]:
    """Places of the nodes of a chain that hangs at rest, from the top, over its length."""
    cable, count = vehicle.cable, vehicle.cable.segments
    step = vehicle.cable_mass / count
    lengths = [
        cable.rest_length / count
        + (vehicle.load.mass + (count - index - 0.5) * step) * vehicle.gravity / (count * cable.stiffness)
        for index in range(count)
    ]
    whole = sum(lengths)
    return [sum(lengths[: index + 1]) / whole for index in range(count - 1)]


def chain_rate(vehicle: Vehicle) -> float:
    """Largest modulus, 1/s, of the eigenvalues of the nodes of a chain; 0 for another cable.

    Neighbours that swing against each other: w² = 4 k / m and 2 s = 4 c / m, of one segment.
    """
    if not vehicle.cable.is_chain:
        return 0.0
    count = vehicle.cable.segments
    factor = 4.0 * count * count / vehicle.cable_mass
    square, half = factor * vehicle.cable.stiffness, 0.5 * factor * vehicle.cable.damping
    return half + math.sqrt(half * half - square) if half * half > square else math.sqrt(square)
