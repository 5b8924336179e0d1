"""Turbulence at one point: Dryden's, with scales and intensities of MIL-F-8785C at low altitude (3.7.3.4,
figures 10 and 11).

A frozen field that drifts past at a constant airspeed, so its time series does not depend on the flight.
Each filter is discretised exactly, state and output covariance included, and starts in its stationary
distribution. The filters are compiled: in Python a table of wind costs as much as all steps under it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from sitl_bridge.compiled import Buffer, entry_point
from sitl_bridge.plant.physics.state import Array
from sitl_bridge.vehicle.description import Turbulence

FEET_PER_METRE = 1.0 / 0.3048


class Dryden(NamedTuple):
    """Scales (m) and intensities (m/s) of turbulence: along the wind, across it, vertical."""

    length: tuple[float, float, float]
    intensity: tuple[float, float, float]


def dryden(turbulence: Turbulence) -> Dryden:
    """MIL-F-8785C below 1000 ft: L_w = h, L_u = L_v = h / (0.177 + 0.000823 h)^1.2 with h in ft;
    sigma_w = 0.1 W_20, sigma_u = sigma_v = sigma_w / (0.177 + 0.000823 h)^0.4."""
    feet = turbulence.height * FEET_PER_METRE
    factor = 0.177 + 0.000823 * feet
    along = feet / factor**1.2 / FEET_PER_METRE
    vertical = 0.1 * turbulence.wind_at_6_m
    level = vertical / factor**0.4
    return Dryden((along, along, turbulence.height), (level, level, vertical))


FILTERS = np.dtype(
    [
        (
            "keep",
            "f8",
        ),  # along the wind: share of a sample that is left in the next, and what noise adds, m/s
        ("std", "f8"),
        ("hold", "f8"),  # s between samples
        ("decay", "f8", 2),  # across and vertical, as everything below
        ("kick", "f8", (2, 3)),  # lower triangle of the factor of the covariance that noise adds in a hold
        ("output", "f8", (2, 2)),
    ]
)
BLOCK = 1024
"""Samples that one call filters at most."""
NORMALS = 5
"""Draws a sample takes: one along the wind, two each across it and vertical."""


@entry_point(
    Buffer(FILTERS, (1,)),
    Buffer(np.float64, (NORMALS,)),
    Buffer(np.float64, (BLOCK, NORMALS)),
    Buffer(np.float64, (BLOCK, 3)),
    int,
)
def filter_block(record: Any, state: Array, normal: Array, out: Array, count: int) -> int:
    """Filter `count` rows of unit normal draws into m/s: along the wind, to the left of it, up.

    state: along, then two of each double pole; changed.
    """
    f = record[0]
    along = state[0]
    for row in range(count):
        along = f.keep * along + f.std * normal[row, 0]
        out[row, 0] = along
    state[0] = along
    for axis in range(2):
        first, second = state[1 + 2 * axis], state[2 + 2 * axis]
        decay, hold = f.decay[axis], f.hold
        for row in range(count):
            one, two = normal[row, 1 + 2 * axis], normal[row, 2 + 2 * axis]
            second = decay * (second + hold * first) + f.kick[axis, 1] * one + f.kick[axis, 2] * two
            first = decay * first + f.kick[axis, 0] * one
            out[row, 1 + axis] = f.output[axis, 0] * first + f.output[axis, 1] * second
        state[1 + 2 * axis], state[2 + 2 * axis] = first, second
    return count


class Turbulent:
    """Dryden turbulence at one point, drawn in blocks of samples `hold` seconds apart, (n, 3) in m/s.

    Along the wind: H = s sqrt(2 L / (pi V)) / (1 + L s / V), across and vertical:
    H = s sqrt(L / (pi V)) (1 + sqrt(3) L s / V) / (1 + L s / V)², driven by white noise. The second is
    realised by z1' = -a z1 + w, z2' = -a z2 + z1, a = V / L, and its output combines both.
    """

    def __init__(self, turbulence: Turbulence, hold: float, generator: np.random.Generator) -> None:
        self.generator = generator
        figures = dryden(turbulence)
        record, self._state = np.zeros(1, dtype=FILTERS), np.zeros(NORMALS)
        f = record[0]
        rate = turbulence.airspeed / figures.length[0]
        f["hold"] = hold
        f["keep"] = math.exp(-rate * hold)
        f["std"] = figures.intensity[0] * math.sqrt(-math.expm1(-2.0 * rate * hold))
        self._state[0] = figures.intensity[0] * float(generator.standard_normal())
        for axis in (0, 1):
            length, intensity = figures.length[axis + 1], figures.intensity[axis + 1]
            pole = double_pole(turbulence.airspeed / length, intensity, hold)
            f["decay"][axis], f["kick"][axis], f["output"][axis] = pole.decay, pole.kick, pole.output
            self._state[1 + 2 * axis : 3 + 2 * axis] = pole.stationary @ generator.standard_normal(2)
        self._normal, self._out = np.zeros((BLOCK, NORMALS)), np.zeros((BLOCK, 3))
        self._filter = filter_block.bind(record, self._state, self._normal, self._out)

    def draw(self, count: int) -> Array:
        """The next `count` samples, (count, 3): along the wind, to the left of it, up."""
        out = np.empty((count, 3))
        for first in range(0, count, BLOCK):
            rows = min(BLOCK, count - first)
            self._normal[:rows] = self.generator.standard_normal((rows, NORMALS))
            self._filter(rows)
            out[first : first + rows] = self._out[:rows]
        return out


class DoublePole(NamedTuple):
    """sigma (1 + sqrt(3) s / a) / (1 + s / a)² of unit-variance output shape, exact at samples."""

    decay: float
    kick: tuple[float, float, float]
    """Lower triangle of the factor of the covariance that white noise adds to (z1, z2) in one hold."""
    stationary: Array
    """Factor (2, 2) of the covariance of (z1, z2) in the long run."""
    output: tuple[float, float]


def double_pole(rate: float, intensity: float, hold: float) -> DoublePole:
    """The filter of poles at -rate (1/s), of so much intensity (m/s), sampled each `hold` seconds."""
    # Covariance that white noise of unit intensity adds in one hold: integrals of (1, t, t²) exp(-2 a t).
    a2, e2 = 2.0 * rate, math.exp(-2.0 * rate * hold)
    i0 = -math.expm1(-a2 * hold) / a2
    i1 = (i0 - hold * e2) / a2
    i2 = (2.0 * i1 - hold * hold * e2) / a2
    factor = np.linalg.cholesky(np.array([[i0, i1], [i1, i2]]))
    stationary = np.linalg.cholesky(np.array([[1.0 / a2, 1.0 / a2**2], [1.0 / a2**2, 2.0 / a2**3]]))
    gain = intensity / math.sqrt(rate) * rate * rate
    return DoublePole(
        math.exp(-rate * hold),
        (float(factor[0, 0]), float(factor[1, 0]), float(factor[1, 1])),
        stationary,
        (gain * math.sqrt(3.0) / rate, gain * (1.0 - math.sqrt(3.0))),
    )
