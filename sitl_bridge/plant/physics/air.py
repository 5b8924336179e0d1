"""Air: drag of vehicle and load; wind, gusts and turbulence at both."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sitl_bridge.compiled import kernel
from sitl_bridge.plant.physics.state import Array
from sitl_bridge.plant.physics.turbulence import Turbulent, dryden
from sitl_bridge.plant.random_streams import stream
from sitl_bridge.vehicle.description import Air, Gust, Vehicle

WIND_HOLD = 0.01
"""s; each row of the wind table holds so long, to the nearest integration step."""


@kernel
def drag_force(
    linear: Any, quadratic: Any, vx: Any, vy: Any, vz: Any, wind_x: Any, wind_y: Any, wind_z: Any
) -> tuple[Any, Any, Any]:
    """Drag on a body, N, world: against its velocity through the air, linear and quadratic in it.

    linear: N s/m; quadratic: N s²/m²; v: m/s, of the body, world; wind: m/s, of the air there, world.
    """
    ux, uy, uz = vx - wind_x, vy - wind_y, vz - wind_z
    slowing = linear + quadratic * (ux * ux + uy * uy + uz * uz) ** 0.5
    return -slowing * ux, -slowing * uy, -slowing * uz


def gust_velocity(gust: Gust, time: Array) -> Array:
    """Air velocity of a 1-cosine gust at each time (n,), (n, 3) in m/s, world ENU."""
    phase = np.clip((time - gust.start) / gust.duration, 0.0, 1.0)
    velocity: Array = 0.5 * (1.0 - np.cos(2.0 * np.pi * phase))[:, None] * np.array(gust.peak)
    return velocity


class Wind:
    """Air velocity at vehicle and load, in rows of `hold` seconds.

    Each body has its own turbulence; theirs are correlated as Dryden's field is over the cable's length,
    exp(-l / L_w), so that a short cable feels one gust and a long one two.
    """

    def __init__(self, vehicle: Vehicle, seed: int, hold: float = WIND_HOLD) -> None:
        self.hold = hold
        self.air: Air = vehicle.air
        self.gusts = list(vehicle.air.gusts)
        self._row = 0
        self._points: list[Turbulent] = []
        if self.air.turbulence is not None:
            self._points = [
                Turbulent(self.air.turbulence, hold, stream(seed, f"turbulence.{body}"))
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
        time = self.hold * (self._row + 0.5 + np.arange(count, dtype=np.float64))
        for gust in self.gusts:
            velocity = gust_velocity(gust, time)
            if gust.acts_on != "load":
                rows[:, :3] += velocity
            if gust.acts_on != "vehicle":
                rows[:, 3:] += velocity
        self._row += count
