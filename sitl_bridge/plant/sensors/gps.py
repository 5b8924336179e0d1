"""GPS: fixes at their own rate, late, noisy, wandering, and now and then none."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from sitl_bridge.frames import Triple
from sitl_bridge.plant.sensors.noise import Dropouts, GaussMarkov
from sitl_bridge.plant.state import VEHICLE_POSITION, VEHICLE_VELOCITY, Array
from sitl_bridge.plant.streams import stream
from sitl_bridge.sensors import Gps

SMALLEST_ACCURACY = 0.01  # m; the wire's unit, and what a receiver says of itself at best
NO_FIX, FIX_3D = 1, 3


class GpsFix(NamedTuple):
    """One GPS solution: m and m/s in the local ENU frame, accuracies in m; `age` s, since it was valid."""

    position: Triple
    velocity: Triple
    horizontal_accuracy: float
    vertical_accuracy: float
    fix_type: int = FIX_3D
    satellites: int = 12
    age: float = 0.0


def fix(gps: Gps, x: Array, draw: Array, wander: Array, delay: float) -> GpsFix:
    """A fix of the state x: draw (6,) of unit normal numbers, wander (3,) in m, delay in s."""
    level, up = gps.horizontal_noise, gps.vertical_noise
    level_speed, up_speed = gps.horizontal_velocity_noise, gps.vertical_velocity_noise
    noise = draw * (level, level, up, level_speed, level_speed, up_speed)
    east, north, height = (x[VEHICLE_POSITION] + wander + noise[:3]).tolist()
    position: Triple = (east, north, height)
    v_east, v_north, v_up = (x[VEHICLE_VELOCITY] + noise[3:]).tolist()
    return GpsFix(
        position,
        (v_east, v_north, v_up),
        max(SMALLEST_ACCURACY, math.hypot(level, gps.horizontal_wander)),
        max(SMALLEST_ACCURACY, math.hypot(up, gps.vertical_wander)),
        satellites=gps.satellites,
        age=delay,
    )


class GpsReceiver:
    """The receiver in time: `sample` at every tick gives the fix that arrives then, if one does."""

    def __init__(self, gps: Gps, tick_period: float, seed: int) -> None:
        self.gps = gps
        self.every = max(1, round(1.0 / (gps.rate * tick_period)))
        """Ticks from fix to fix."""
        self.late = round(gps.delay / tick_period)
        """Ticks from a fix's validity to its arrival."""
        self._delay = self.late * tick_period
        self._under_way: deque[tuple[int, GpsFix]] = deque()
        period = self.every * tick_period
        std = np.array([gps.horizontal_wander, gps.horizontal_wander, gps.vertical_wander])
        self._white = stream(seed, "gps.white")
        self._wander = GaussMarkov(std, gps.wander_time, period, stream(seed, "gps.wander"))
        self._dropouts = Dropouts(
            gps.dropouts_per_hour, gps.dropout_duration, period, stream(seed, "gps.dropouts")
        )

    def sample(self, tick: int, x: Array, lost: bool = False) -> GpsFix | None:
        """The fix that arrives at `tick` (counted from 0, each once), the state being x now.

        lost: a fault takes the signal away; the receiver then says at its rate that it has no fix.
        """
        if tick % self.every == 0:
            found = fix(self.gps, x, self._white.standard_normal(6), self._wander.step(), self._delay)
            if self._dropouts.step() or lost:
                found = found._replace(
                    fix_type=NO_FIX, satellites=0, horizontal_accuracy=100.0, vertical_accuracy=100.0
                )
            self._under_way.append((tick + self.late, found))
        if self._under_way and self._under_way[0][0] <= tick:
            return self._under_way.popleft()[1]
        return None
