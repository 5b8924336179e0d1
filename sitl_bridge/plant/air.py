"""Air: drag of vehicle and load; wind, gusts and turbulence at both.

Turbulence is Dryden's, with scales and intensities of MIL-F-8785C at low altitude (3.7.3.4, figures 10 and
11): a frozen field that drifts past at a constant airspeed, so its time series does not depend on the
flight. Each filter is discretised exactly, state and output covariance included, and starts in its
stationary distribution.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from sitl_bridge.compiled import kernel
from sitl_bridge.plant.state import Array
from sitl_bridge.plant.streams import stream
from sitl_bridge.vehicle import Air, Gust, Turbulence, Vehicle

FEET_PER_METRE = 1.0 / 0.3048
WIND_HOLD = 0.01
"""s; each row of the wind table holds so long."""


@kernel
def add_drag(p: Any, x: Array, wind: Array, out: Array) -> None:
    """Add what drag does to the accelerations of vehicle and load.

    p: parameter record; x: state; wind: (6,) air velocity at vehicle and load, m/s, world; out: (19,),
    changed.
    """
    ux, uy, uz = x[3] - wind[0], x[4] - wind[1], x[5] - wind[2]
    speed = (ux * ux + uy * uy + uz * uz) ** 0.5
    slowing = (p.vehicle_drag[0] + p.vehicle_drag[1] * speed) / p.vehicle_mass
    out[3] -= slowing * ux
    out[4] -= slowing * uy
    out[5] -= slowing * uz
    ux, uy, uz = x[16] - wind[3], x[17] - wind[4], x[18] - wind[5]
    speed = (ux * ux + uy * uy + uz * uz) ** 0.5
    slowing = (p.load_drag[0] + p.load_drag[1] * speed) / p.load_mass
    out[16] -= slowing * ux
    out[17] -= slowing * uy
    out[18] -= slowing * uz


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


class Turbulent:
    """Dryden turbulence at one point, drawn in blocks of samples `hold` seconds apart, (n, 3) in m/s.

    Along the wind: H = s sqrt(2 L / (pi V)) / (1 + L s / V), across and vertical:
    H = s sqrt(L / (pi V)) (1 + sqrt(3) L s / V) / (1 + L s / V)², driven by white noise. The second is
    realised by z1' = -a z1 + w, z2' = -a z2 + z1, a = V / L, and its output combines both.
    """

    def __init__(self, turbulence: Turbulence, hold: float, generator: np.random.Generator) -> None:
        self.generator = generator
        figures = dryden(turbulence)
        rate = turbulence.airspeed / figures.length[0]
        self._keep = math.exp(-rate * hold)
        self._std = figures.intensity[0] * math.sqrt(-math.expm1(-2.0 * rate * hold))
        self._along = figures.intensity[0] * float(generator.standard_normal())
        self._axes = [
            _DoublePole(turbulence.airspeed / figures.length[axis], figures.intensity[axis], hold, generator)
            for axis in (1, 2)
        ]

    def draw(self, count: int) -> Array:
        """The next `count` samples, (count, 3): along the wind, to the left of it, up."""
        normal = self.generator.standard_normal((count, 5))
        out = np.empty((count, 3))
        along = self._along
        for row, value in enumerate((self._std * normal[:, 0]).tolist()):
            along = self._keep * along + value
            out[row, 0] = along
        self._along = along
        for axis, pole in enumerate(self._axes):
            out[:, axis + 1] = pole.run(normal[:, 1 + 2 * axis : 3 + 2 * axis])
        return out


class _DoublePole:
    """sigma (1 + sqrt(3) s / a) / (1 + s / a)² of unit-variance output shape, exact at samples."""

    def __init__(self, rate: float, intensity: float, hold: float, generator: np.random.Generator) -> None:
        self.decay = math.exp(-rate * hold)
        self.hold = hold
        # Covariance that white noise of unit intensity adds in one hold: integrals of (1, t, t²) exp(-2 a t).
        a2, e2 = 2.0 * rate, math.exp(-2.0 * rate * hold)
        i0 = -math.expm1(-a2 * hold) / a2
        i1 = (i0 - hold * e2) / a2
        i2 = (2.0 * i1 - hold * hold * e2) / a2
        self.factor = np.linalg.cholesky(np.array([[i0, i1], [i1, i2]]))
        stationary = np.array([[1.0 / a2, 1.0 / a2**2], [1.0 / a2**2, 2.0 / a2**3]])
        self.state = np.linalg.cholesky(stationary) @ generator.standard_normal(2)
        gain = intensity / math.sqrt(rate) * rate * rate
        self.output = np.array([gain * math.sqrt(3.0) / rate, gain * (1.0 - math.sqrt(3.0))])

    def run(self, normal: Array) -> Array:
        """Filter (n, 2) unit normal draws into (n,) samples."""
        kicks = (normal @ self.factor.T).tolist()
        first, second = self.state.tolist()
        path = np.empty((len(kicks), 2))
        decay, hold = self.decay, self.hold
        for row, (one, two) in enumerate(kicks):
            first, second = decay * first + one, decay * (second + hold * first) + two
            path[row] = first, second
        self.state[:] = first, second
        wind: Array = path @ self.output
        return wind


def gust_velocity(gust: Gust, time: Array) -> Array:
    """Air velocity of a 1-cosine gust at each time (n,), (n, 3) in m/s, world ENU."""
    phase = np.clip((time - gust.start) / gust.duration, 0.0, 1.0)
    velocity: Array = 0.5 * (1.0 - np.cos(2.0 * np.pi * phase))[:, None] * np.array(gust.peak)
    return velocity


class Wind:
    """Air velocity at vehicle and load, in rows of `WIND_HOLD` seconds.

    Each body has its own turbulence; theirs are correlated as Dryden's field is over the cable's length,
    exp(-l / L_w), so that a short cable feels one gust and a long one two.
    """

    def __init__(self, vehicle: Vehicle, seed: int) -> None:
        self.air: Air = vehicle.air
        self.gusts = list(vehicle.air.gusts)
        self._row = 0
        self._points: list[Turbulent] = []
        if self.air.turbulence is not None:
            self._points = [
                Turbulent(self.air.turbulence, WIND_HOLD, stream(seed, f"turbulence.{body}"))
                for body in ("vehicle", "load")
            ]
            self._shared = math.exp(-vehicle.hover_length / dryden(self.air.turbulence).length[2])

    @property
    def constant(self) -> bool:
        """Whether it never changes."""
        return not (self._points or self.gusts)

    def fill(self, rows: Array) -> None:
        """Write the next rows (n, 6): at the vehicle, at the load, m/s, world ENU."""
        count = len(rows)
        rows[:, :3] = rows[:, 3:] = self.air.wind
        if self._points:
            # Along and across are those of the mean wind; without one, of a wind from the west.
            east, north, _ = self.air.wind
            angle = math.atan2(north, east)
            turn = np.array(
                [[math.cos(angle), math.sin(angle), 0.0], [-math.sin(angle), math.cos(angle), 0.0], [0, 0, 1]]
            )
            at_vehicle, own = (point.draw(count) @ turn for point in self._points)
            rows[:, :3] += at_vehicle
            rows[:, 3:] += self._shared * at_vehicle + math.sqrt(1.0 - self._shared**2) * own
        # A row holds the mean of its interval, to second order: the value in its middle.
        time = WIND_HOLD * (self._row + 0.5 + np.arange(count, dtype=np.float64))
        for gust in self.gusts:
            velocity = gust_velocity(gust, time)
            if gust.acts_on != "load":
                rows[:, :3] += velocity
            if gust.acts_on != "vehicle":
                rows[:, 3:] += velocity
        self._row += count
