"""A cable of a material as figures: its static curve, its relaxation, and what it linearises to.

Static tension over strain e: T(e) = scale (exp(rate e) - 1), monotone; rate < 0 softens, rate > 0 stiffens.
Each of six Maxwell branches adds w (T(e) - T(a)), with its own relaxed strain a' = (e - a) / tau. Each is a
nonlinear spring in series with a damper: it stores w (W(e) - W(a) - T(a)(e - a)) >= 0 and only dissipates.
At any tension a small oscillation has the complex stiffness T'(e) (1 + sum w i x / (1 + i x)), x = tau omega.
The weights are fitted so that the loss factor holds from 1/30 to 3 times the bounce frequency, and exactly at
it. Ropes lose much the same share of energy at any frequency.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.vehicle.cable_materials import MATERIALS, USUAL_MATERIAL, Material, circle

if TYPE_CHECKING:
    from sitl_bridge.vehicle.description import Cable, Vehicle

BRANCHES = 6
BRANCH_SPEEDS: NDArray[np.float64] = 10.0 ** np.linspace(-2.0, 0.5, BRANCHES)
"""1/tau of each branch, over the angular frequency of the bounce."""
_FITTED = 10.0 ** np.linspace(-1.5, 0.5, 41)
_EXACT = 1e3  # weight of the bounce frequency itself in the fit


class Branches(NamedTuple):
    """The relaxation of a cable of some loss factor."""

    weights: NDArray[np.float64]
    """(6,), each over the static stiffness."""
    stiffening: float
    """Stiffness at the bounce frequency over static stiffness."""


class CableLaw(NamedTuple):
    """Figures of a cable of a material."""

    scale: float
    """N, of the static curve."""
    rate: float
    """1, of the static curve, a strain's factor."""
    breaking_load: float
    """N, of the rope itself."""
    area: float
    """m²."""
    material: Material
    loss_factor: float

    def tension(self, strain: float) -> float:
        """Static tension, N."""
        return self.scale * math.expm1(self.rate * strain)

    def strain(self, tension: float) -> float:
        """Strain under a static tension, N."""
        return math.log1p(tension / self.scale) / self.rate

    def tangent(self, tension: float) -> float:
        """Static stiffness at a static tension, N per strain."""
        return self.rate * (self.scale + tension)


def cable_law(vehicle: Vehicle) -> CableLaw:
    """The law of a vehicle's cable. Without a size it is one that its load strains as usual."""
    cable = vehicle.cable
    material = MATERIALS[cable.material or USUAL_MATERIAL]
    if cable.diameter is not None:
        load = material.strength * circle(cable.diameter)
    else:
        load = cable.breaking_tension or vehicle.load.mass * vehicle.gravity / material.working_share
    return CableLaw(
        load / math.expm1(material.shape),
        material.shape / material.breaking_strain,
        load,
        material.area(load),
        material,
        material.loss_factor if cable.loss_factor is None else cable.loss_factor,
    )


def branches(loss_factor: float) -> Branches:
    """Maxwell branches whose loss factor is this one around the bounce frequency.

    Least squares over weights that are not negative: branches that would be are left out.
    """
    x = _FITTED[:, None] / BRANCH_SPEEDS
    loss, storage = x / (1.0 + x * x), x * x / (1.0 + x * x)
    rows = loss - loss_factor * storage
    importance = np.where(np.isclose(_FITTED, 1.0), _EXACT, 1.0)
    target = np.full(len(_FITTED), loss_factor) * importance
    weights = np.zeros(BRANCHES)
    kept = np.arange(BRANCHES)
    while True:
        found, *_ = np.linalg.lstsq(rows[:, kept] * importance[:, None], target, rcond=None)
        if np.all(found > 0.0):
            break
        kept = np.delete(kept, np.argmin(found))
    weights[kept] = found
    at_bounce = 1.0 / BRANCH_SPEEDS
    return Branches(weights, 1.0 + float(np.sum(weights * at_bounce**2 / (1.0 + at_bounce**2))))


def bounce_rate(vehicle: Vehicle, law: CableLaw) -> float:
    """Angular frequency of the bounce of load against vehicle about hover, rad/s, undamped."""
    stiffness = law.tangent(vehicle.load.mass * vehicle.gravity) / vehicle.cable.rest_length
    inverse_mass = 1.0 / vehicle.airframe.mass + 1.0 / vehicle.load.mass
    return math.sqrt(stiffness * branches(law.loss_factor).stiffening * inverse_mass)


def linear_cable(vehicle: Vehicle) -> Cable:
    """The spring and damper that acts as the vehicle's cable does about hover; itself where it is one.

    Stiffness and loss are those at the bounce frequency; the length under the load's weight is the same.
    """
    cable = vehicle.cable
    if cable.is_chain:
        return cable.model_copy(update={"model": "tension-only"})
    if cable.is_linear:
        return cable
    law, weight = cable_law(vehicle), vehicle.load.mass * vehicle.gravity
    stiffness = law.tangent(weight) / cable.rest_length * branches(law.loss_factor).stiffening
    length = cable.rest_length * (1.0 + law.strain(weight))
    return cable.model_copy(
        update={
            "model": "tension-only",
            "material": None,
            "diameter": None,
            "loss_factor": None,
            "stiffness": stiffness,
            "damping": law.loss_factor * stiffness / bounce_rate(vehicle, law),
            "rest_length": length - weight / stiffness,
            "breaking_tension": cable.breaking_tension or law.breaking_load,
        }
    )


def linearised(vehicle: Vehicle) -> Vehicle:
    """The vehicle on the linear cable that its own acts as about hover; itself where its cable is linear.

    Vehicle and load carry half of a chain each.
    """
    cable = linear_cable(vehicle)
    if cable is vehicle.cable:
        return vehicle
    half = 0.5 * vehicle.cable_mass
    bodies = {
        name: body.model_copy(update={"mass": body.mass + half})
        for name, body in (("airframe", vehicle.airframe), ("load", vehicle.load))
    }
    return vehicle.model_copy(update={"cable": cable, **bodies})
