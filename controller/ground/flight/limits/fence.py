"""Where the vehicle may be: the geofence, and the height that keeps the load off the ground."""

from __future__ import annotations

import math
from typing import NamedTuple

from controller.ground.flight.limits.fence_zones import Zone
from controller.ground.flight.limits.fence_zones import outside as outside_zones
from controller.ground.parameters.protocol import Parameters
from controller.ground.telemetry.vehicle_state import Profile
from sitl_bridge.frames import Triple


class Fence(NamedTuple):
    """The limits around home, as the parameters have them now. Positions are the vehicle's, m ENU."""

    home: Triple
    radius: float
    """m, 0: none"""
    height: float
    """m, 0: none"""
    least_height: float
    """m above home for a vehicle with a hanging load; -inf where there is no ground"""

    zones: tuple[Zone, ...] = ()
    ahead: str = ""
    """What of the fence is left if the vehicle does not brake now; empty: nothing"""

    def outside(self, point: Triple) -> str:
        """Why a position is outside the geofence, or an empty string."""
        distance = math.hypot(point[0] - self.home[0], point[1] - self.home[1])
        if self.radius > 0 and not distance <= self.radius:
            return (
                f"{distance:.0f} m from home is outside the geofence of {self.radius:g} m (GF_MAX_HOR_DIST)"
            )
        above = point[2] - self.home[2]
        if self.height > 0 and not above <= self.height:
            return f"{above:.0f} m above home is outside the geofence of {self.height:g} m (GF_MAX_VER_DIST)"
        return outside_zones(self.zones, point[:2])

    def too_low(self, point: Triple) -> str:
        """Why the load would touch the ground with the vehicle at a position, or an empty string."""
        above = point[2] - self.home[2]
        if above < self.least_height - 0.01:
            least = f"at least {self.least_height:.1f} m (LND_CLEARANCE)"
            return f"{above:.1f} m above home is too low for the load; {least}"
        return ""

    def raised(self, point: Triple) -> Triple:
        """The position itself, or the lowest above it that keeps the load off the ground."""
        return (point[0], point[1], max(point[2], self.home[2] + self.least_height))


def fence_around(
    home: Triple,
    parameters: Parameters,
    profile: Profile,
    with_load: bool = True,
    zones: tuple[Zone, ...] = (),
) -> Fence:
    """The fence of the parameters."""
    hanging = profile.hover_length + parameters["LND_CLEARANCE"] if with_load else parameters["LND_CLEARANCE"]
    return Fence(
        home,
        parameters["GF_MAX_HOR_DIST"],
        parameters["GF_MAX_VER_DIST"],
        hanging if profile.has_ground else -math.inf,
        zones,
    )
