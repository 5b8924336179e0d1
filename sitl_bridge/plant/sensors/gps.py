"""GPS: fixes at their own rate, late, noisy, wandering, and now and then none."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from sitl_bridge.frames import Triple
from sitl_bridge.plant.physics.state import VEHICLE_POSITION, VEHICLE_VELOCITY, Array
from sitl_bridge.plant.random_streams import stream
from sitl_bridge.plant.sensors.instruments import GARBAGE, LOST, OFF, STUCK, WORKS, WRONG
from sitl_bridge.plant.sensors.noise import Dropouts, GaussMarkov
from sitl_bridge.vehicle.sensors import Gps

SMALLEST_ACCURACY = 0.01  # m; the wire's unit, and what a receiver says of itself at best
NO_FIX, FIX_3D = 1, 3
NO_ACCURACY = 100.0
"""m, claimed without a fix."""
WRONG_BY = 20.0
"""m, to the east, of a wrong receiver."""
GARBAGE_RANGE, GARBAGE_SPEED = 1000.0, 100.0
"""Garbage is uniform in ± this, m and m/s."""


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
    # Plain numbers: NumPy takes several times as long for so few.
    d, w = draw.tolist(), wander.tolist()
    east, north, height = x[VEHICLE_POSITION].tolist()
    v_east, v_north, v_up = x[VEHICLE_VELOCITY].tolist()
    return GpsFix(
        (east + w[0] + level * d[0], north + w[1] + level * d[1], height + w[2] + up * d[2]),
        (v_east + level_speed * d[3], v_north + level_speed * d[4], v_up + up_speed * d[5]),
        max(SMALLEST_ACCURACY, math.hypot(level, gps.horizontal_wander)),
        max(SMALLEST_ACCURACY, math.hypot(up, gps.vertical_wander)),
        satellites=gps.satellites,
        age=delay,
    )


def without_fix(found: GpsFix) -> GpsFix:
    """What a receiver says that sees no satellites."""
    return found._replace(
        fix_type=NO_FIX, satellites=0, horizontal_accuracy=NO_ACCURACY, vertical_accuracy=NO_ACCURACY
    )


def spoil(found: GpsFix, doing: int, last: GpsFix | None, generator: np.random.Generator) -> GpsFix | None:
    """What a failing receiver makes of a fix; None: nothing."""
    east, north, up = found.position
    if doing == OFF:
        return None
    if doing == LOST:
        return without_fix(found)
    if doing == STUCK:
        return last or found
    if doing == WRONG:
        return found._replace(position=(east + WRONG_BY, north, up))
    if doing == GARBAGE:
        a, b, c, *velocity = generator.uniform(-1.0, 1.0, 6).tolist()
        scattered = (east + GARBAGE_RANGE * a, north + GARBAGE_RANGE * b, up + GARBAGE_RANGE * c)
        u, v, w = (GARBAGE_SPEED * part for part in velocity)
        return found._replace(position=scattered, velocity=(u, v, w))
    return found


class GpsReceiver:
    """The receiver in time: `sample` at every tick gives the fix that arrives then, if one does."""

    def __init__(self, gps: Gps, tick_period: float, seed: int) -> None:
        self.gps = gps
        self.every = max(1, round(1.0 / (gps.rate * tick_period)))
        """Ticks from fix to fix."""
        self.late = round(gps.delay / tick_period)
        """Ticks from a fix's validity to its arrival."""
        self.doing = WORKS
        """What the receiver does, as of the instruments; set by faults."""
        self._delay = self.late * tick_period
        self._last: GpsFix | None = None
        self._garbage = stream(seed, "gps.garbage")
        self._under_way: deque[tuple[int, GpsFix]] = deque()
        period = self.every * tick_period
        std = np.array([gps.horizontal_wander, gps.horizontal_wander, gps.vertical_wander])
        self._white = stream(seed, "gps.white")
        self._wander = GaussMarkov(std, gps.wander_time, period, stream(seed, "gps.wander"))
        self._dropouts = Dropouts(
            gps.dropouts_per_hour, gps.dropout_duration, period, stream(seed, "gps.dropouts")
        )

    def ticks_left(self, tick: int) -> int:
        """How many ticks after `tick` pass without anything to do for the receiver."""
        ticks = self.every - 1 - tick % self.every
        return min(ticks, self._under_way[0][0] - tick - 1) if self._under_way else ticks

    def sample(self, tick: int, x: Array) -> GpsFix | None:
        """The fix that arrives at `tick` (counted from 0 or 1, each once), the state being x now."""
        if tick % self.every == 0:
            found = fix(self.gps, x, self._white.standard_normal(6), self._wander.step(), self._delay)
            found = without_fix(found) if self._dropouts.step() else found
            spoilt = spoil(found, self.doing, self._last, self._garbage)
            if spoilt is not None:
                self._last = spoilt
                self._under_way.append((tick + self.late, spoilt))
        if self._under_way and self._under_way[0][0] <= tick:
            return self._under_way.popleft()[1]
        return None
