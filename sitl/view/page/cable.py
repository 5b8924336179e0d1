"""The cable drawn by viser: a rod for each straight piece, coloured by tension.

Poses of bodies reach the browser at once, points of a line late: a cable drawn as a line would trail behind.
"""

from __future__ import annotations

import colorsys
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl.view.view import View
from sitl_bridge.frames import Quaternion, Triple
from sitl_bridge.vehicle.cable_law import linear_cable
from sitl_bridge.vehicle.description import Vehicle

Colour = tuple[int, int, int]
_SLACK: Colour = (150, 150, 150)
THICKNESS, THICKNESS_SHARE = 0.008, 0.002
"""m, radius of a rod, and how much more for each metre of cable: a long one is seen from further away."""
LENGTH_STEP = 0.005
"""Share by which a piece's length changes before its rod is drawn longer."""
COLOUR_STEPS = 8
"""Shades from green to red."""


class CableScene:
    """server's scene."""

    def __init__(self, scene: Any, vehicle: Vehicle) -> None:
        self._scene = scene
        self._vehicle = vehicle
        self._radius = THICKNESS + THICKNESS_SHARE * vehicle.cable.rest_length
        self._rods: list[Any] = []

    def show(self, view: View) -> None:
        """From vehicle to load, through a chain's nodes; nothing once it joins them no more."""
        broken = view.tension is not None and math.isnan(view.tension)
        if view.vehicle is None or view.load is None or broken:
            for rod in self._rods:
                rod.visible = False
            return
        points = np.array([view.vehicle, *view.nodes, view.load])
        shares = load_shares(self._vehicle, view.tension, points)
        self._have(len(shares), view.cable_length or 1.0, colour_of(shares[0]))
        for rod, top, bottom, share in zip(self._rods, points[:-1], points[1:], shares, strict=True):
            length = float(np.linalg.norm(bottom - top))
            if length == 0.0:
                continue
            rod.position, rod.wxyz, rod.visible = 0.5 * (top + bottom), along((bottom - top) / length), True
            if abs(rod.scale[2] / length - 1.0) > LENGTH_STEP:
                rod.scale = (1.0, 1.0, length)
            colour = colour_of(share)
            if rod.color != colour:
                rod.color = colour

    def _have(self, count: int, length: float, colour: Colour) -> None:
        """So many rods, new ones of this colour and length over all (m): changes come late to the browser."""
        while len(self._rods) > count:
            self._rods.pop().remove()
        while len(self._rods) < count:
            rod = self._scene.add_cylinder(
                f"/cable/{len(self._rods)}",
                radius=self._radius,
                height=1.0,
                color=colour,
                radial_segments=8,
                scale=(1.0, 1.0, length / count),
                cast_shadow=False,
            )
            self._rods.append(rod)


def along(direction: NDArray[np.float64] | Triple) -> Quaternion:
    """The shortest turn of the z axis to a direction, a unit vector."""
    x, y, z = (float(part) for part in direction)
    if z < -1.0 + 1e-12:
        return (0.0, 1.0, 0.0, 0.0)
    norm = math.sqrt(2.0 * (1.0 + z))
    return (0.5 * norm, -y / norm, x / norm, 0.0)


def load_shares(vehicle: Vehicle, tension: float | None, points: NDArray[np.float64]) -> list[float]:
    """Tension over the load's weight in each piece of a cable through points (n, 3), m.

    A chain's tension is told at its top. The other pieces differ from the topmost in length by what their
    springs pull more or less. Where no tension is told, the springs pull as described.
    """
    cable, pieces = linear_cable(vehicle), len(points) - 1
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if tension is not None and (pieces == 1 or tension > 0.0):
        tensions = tension + cable.stiffness * pieces * (lengths - lengths[0])
    else:
        tensions = cable.stiffness * (pieces * lengths - cable.rest_length)
    tensions = np.maximum(0.0, tensions)
    shares: list[float] = (tensions / (vehicle.load.mass * vehicle.gravity)).tolist()
    return shares


def colour_of(share: float) -> Colour:
    """Grey while slack, green up to the load's weight, red at twice that."""
    if share <= 0.0:
        return _SLACK
    excess = round(COLOUR_STEPS * min(1.0, max(0.0, share - 1.0))) / COLOUR_STEPS
    red, green, blue = colorsys.hsv_to_rgb((1.0 - excess) / 3.0, 0.85, 0.8)
    return (round(255 * red), round(255 * green), round(255 * blue))
