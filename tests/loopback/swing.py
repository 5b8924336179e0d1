"""What a state log says of a flight's manners: how far the load swung, how far corners were overshot."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Flown(NamedTuple):
    """A flight by the simulated truth, m, world ENU."""

    time: Array
    """s"""
    vehicle: Array
    """(n, 3)"""
    load: Array
    """(n, 3)"""

    def between(self, begin: float, end: float) -> Flown:
        """The part from one time to another, s."""
        part = (self.time >= begin) & (self.time <= end)
        return Flown(self.time[part], self.vehicle[part], self.load[part])


def read(path: Path) -> Flown:
    """A flight from its state log."""
    table = pq.read_table(path)
    vehicle, load = (
        np.stack([table[f"{body}_{axis}_m"].to_numpy() for axis in "xyz"], axis=1)
        for body in ("vehicle", "load")
    )
    return Flown(table["time_s"].to_numpy(), vehicle, load)


def swing(flown: Flown) -> Array:
    """Angle of the cable from the vertical, degrees (n,)."""
    away = flown.vehicle - flown.load
    return np.asarray(np.degrees(np.arctan2(np.hypot(away[:, 0], away[:, 1]), away[:, 2])))


def overshoots(positions: Array, corners: Array) -> Array:
    """How far each corner (n, 3) is passed in the direction of the leg that leads to it, m (n - 1,).

    A leg's part of the flight begins where the position was nearest to the corner before.
    """
    found, begin = [], 0
    for before, corner in pairwise(corners):
        leg = (corner - before) / np.linalg.norm(corner - before)
        found.append(float(np.max((positions[begin:] - corner) @ leg)))
        begin += int(np.argmin(np.linalg.norm(positions[begin:] - corner, axis=1)))
    return np.array(found)
