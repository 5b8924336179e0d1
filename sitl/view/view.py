"""One moment of a flight, as it is drawn. World ENU, body FLU, SI units."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sitl.view.plan import NO_PLAN, Plan
from sitl_bridge.frames import Quaternion, Triple, rotate

UPRIGHT: Quaternion = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class View:
    """What is known; None where nothing has said it."""

    time_s: float = 0.0
    """Since the scenario began, or since the first message."""
    of_scenario: bool = False
    """Whether the time is the scenario's."""
    vehicle: Triple | None = None
    """m."""
    attitude: Quaternion = UPRIGHT
    """FLU to world."""
    load: Triple | None = None
    """m."""
    set_point: Triple | None = None
    """m, where the load is to be."""
    rotors: tuple[float, ...] = ()
    """Speed of each over its largest, 0 to 1."""
    armed: bool | None = None
    mode: str | None = None
    battery: float | None = None
    """Charge left, 0 to 1."""
    tension: float | None = None
    """N, of the cable; NaN once it has broken or let go."""
    nodes: tuple[Triple, ...] = ()
    """m, of a cable that is a chain, from the vehicle to the load."""
    wind: Triple | None = None
    """m/s."""
    plan: Plan = NO_PLAN
    """Mission, geofence and rally points on board."""
    speed: float | None = None
    """Simulated seconds a second that the plant is asked for; 0: paused, below 0: as fast as it goes."""
    steerable: bool = False
    """Whether the speed can be changed."""
    texts: tuple[str, ...] = ()
    """The latest STATUSTEXTs, newest last."""

    @property
    def swing(self) -> float | None:
        """Angle of the line from vehicle to load against the vertical, rad."""
        if self.vehicle is None or self.load is None:
            return None
        x, y, z = (v - p for v, p in zip(self.vehicle, self.load, strict=True))
        return math.atan2(math.hypot(x, y), z)

    @property
    def tilt(self) -> float:
        """Angle of the vehicle's z axis against the vertical, rad."""
        return math.acos(max(-1.0, min(1.0, rotate(self.attitude, (0.0, 0.0, 1.0))[2])))

    @property
    def cable_length(self) -> float | None:
        """Distance from vehicle to load, m."""
        if self.vehicle is None or self.load is None:
            return None
        return math.dist(self.vehicle, self.load)
