"""The load's tracker: where a camera under the vehicle sees the load, for LANDING_TARGET."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from sitl_bridge.frames import Triple, rotate_inverse
from sitl_bridge.plant.physics.state import ATTITUDE, LOAD_POSITION, VEHICLE_POSITION, Array
from sitl_bridge.plant.random_streams import stream
from sitl_bridge.plant.sensors.instruments import GARBAGE, OFF, STUCK, WORKS, WRONG
from sitl_bridge.vehicle.sensors import Tracker

WRONG_BY = 0.5
"""m, forward, of a wrong camera."""


class Sighting(NamedTuple):
    """Where the load is seen from the vehicle: m, body FLU; `age` s, since the exposure."""

    position: Triple
    age: float


def sighting(tracker: Tracker, x: Array, draw: Array, delay: float) -> Sighting | None:
    """What the camera sees of the state x, or None: draw (3,) of unit normal numbers.

    Noise is an angle across the line of sight, and a share of the distance along it.
    """
    w, qx, qy, qz = x[ATTITUDE].tolist()
    vehicle, load = x[VEHICLE_POSITION].tolist(), x[LOAD_POSITION].tolist()
    offset: Triple = (load[0] - vehicle[0], load[1] - vehicle[1], load[2] - vehicle[2])
    px, py, pz = rotate_inverse((w, qx, qy, qz), offset)
    distance = math.sqrt(px * px + py * py + pz * pz)
    if distance == 0.0 or distance > tracker.range or -pz < distance * math.cos(tracker.field_of_view):
        return None
    a, b, c = draw.tolist()
    across = distance * tracker.angle_noise
    # What the draw has along the line of sight is replaced by the noise of the distance.
    share = (px * a + py * b + pz * c) / distance * (tracker.distance_noise - tracker.angle_noise)
    return Sighting(
        (px + across * a + share * px, py + across * b + share * py, pz + across * c + share * pz), delay
    )


def spoil(
    seen: Sighting | None, doing: int, last: Sighting | None, reach: float, draw: Array, delay: float
) -> Sighting | None:
    """What a failing camera makes of what it sees; None: nothing.

    last: what it showed before; reach: of garbage, m; draw (3,): uniform in ±1; delay: of garbage, s.
    """
    if doing == OFF:
        return None
    if doing == STUCK:
        return last or seen
    if doing == GARBAGE:
        x, y, z = (reach * draw).tolist()
        return Sighting((x, y, z), delay)
    if doing == WRONG and seen is not None:
        x, y, z = seen.position
        return seen._replace(position=(x + WRONG_BY, y, z))
    return seen


class LoadTracker:
    """The camera in time: `sample` at every tick gives the sighting that arrives then, if one does."""

    def __init__(self, tracker: Tracker, tick_period: float, seed: int) -> None:
        self.tracker = tracker
        self.every = max(1, round(1.0 / (tracker.rate * tick_period)))
        self.late = round(tracker.delay / tick_period)
        self.doing = WORKS
        """What the camera does, as of the instruments; set by faults."""
        self._delay = self.late * tick_period
        self.newest: Sighting | None = None
        """The sighting that has arrived last; None: none has."""
        self.arrived = 0
        """How many have arrived."""
        self._under_way: deque[tuple[int, Sighting]] = deque()
        self._last: Sighting | None = None
        self._white = stream(seed, "tracker.white")
        self._garbage = stream(seed, "tracker.garbage")

    def ticks_left(self, tick: int) -> int:
        """How many ticks after `tick` pass without anything to do for the camera."""
        ticks = self.every - 1 - tick % self.every
        return min(ticks, self._under_way[0][0] - tick - 1) if self._under_way else ticks

    def sample(self, tick: int, x: Array) -> Sighting | None:
        """The sighting that arrives at `tick` (counted from 0 or 1, each once)."""
        if tick % self.every == 0:
            seen = sighting(self.tracker, x, self._white.standard_normal(3), self._delay)
            if self.doing != WORKS:
                garbage = self._garbage.uniform(-1.0, 1.0, 3)
                seen = spoil(seen, self.doing, self._last, self.tracker.range, garbage, self._delay)
            if seen is not None:
                self._last = seen
                self._under_way.append((tick + self.late, seen))
        if self._under_way and self._under_way[0][0] <= tick:
            self.newest = self._under_way.popleft()[1]
            self.arrived += 1
            return self.newest
        return None
