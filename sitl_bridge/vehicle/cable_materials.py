"""What cables are made of: force over strain, loss factor and weight. Sources: docs/cables.md."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

MaterialName = Literal["nylon", "polyester", "dyneema", "rubber"]


class Material(NamedTuple):
    """A rope's figures, on the area of the circle that its diameter encloses."""

    strength: float
    """Pa: stress at which it breaks."""
    breaking_strain: float
    """Strain at which it breaks."""
    shape: float
    """Of the curve of force over strain: e to this power is the stiffness at break over that at no load."""
    loss_factor: float
    """Energy lost in a cycle over 2 pi times the energy stored, at small amplitude."""
    density: float
    """kg/m³."""
    working_share: float
    """Share of the breaking load that the load's weight takes where no size is given."""

    def area(self, breaking_load: float) -> float:
        """Area, m², of the rope that breaks at this load, N."""
        return breaking_load / self.strength


MATERIALS: dict[MaterialName, Material] = {
    "nylon": Material(295e6, 0.30, 1.5, 0.10, 800.0, 0.1),
    "polyester": Material(221e6, 0.15, 0.3, 0.08, 970.0, 0.1),
    "dyneema": Material(1.35e9, 0.033, 0.2, 0.05, 680.0, 0.1),
    "rubber": Material(0.91e6, 1.5, -0.89, 0.08, 930.0, 0.25),
}
USUAL_MATERIAL: MaterialName = "nylon"


def circle(diameter: float) -> float:
    """Area, m², of a circle of this diameter, m."""
    return 0.25 * math.pi * diameter * diameter
