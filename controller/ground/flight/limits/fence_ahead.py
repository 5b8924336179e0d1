"""Whether the vehicle is about to leave the geofence: early enough to stop at it, not behind it.

PX4 reacts when a point is outside already (GF_PREDICT, by default off, looks ahead). A plan that crosses an
exclusion zone is flown as far as that here: to where vehicle and load can still come to rest.
"""

from __future__ import annotations

import math

from controller.ground.flight.limits.fence import Fence
from controller.ground.flight.limits.fence_zones import Place, crosses
from controller.ground.parameters.protocol import Parameters
from controller.ground.telemetry.vehicle_state import Profile, VehicleView
from sitl_bridge.frames import Triple

LATENCY = 0.15
"""s, from a look at the fence until the vehicle brakes"""
_SLOW = 0.2
"""m/s, at which a vehicle is not on its way anywhere"""
_SAMPLES = 20
"""Points of a way that are looked at for leaving the inclusion zones"""


def fence_ahead(
    view: VehicleView, fence: Fence, stop: Triple, goal: Triple | None, p: Parameters, profile: Profile
) -> str:
    """Why vehicle or load would be outside the fence if they braked any later, or an empty string.

    stop: where the controlled body comes to rest if it brakes now. goal: where the vehicle flies to and
    stays, m ENU; None: it is on its way without an end. A goal on a clear way is flown to without looking
    further, however near the fence it lies.
    """
    if not fence.zones and fence.radius <= 0:
        return ""
    here, velocity = (
        (view.load_position, view.load_velocity) if view.load_attached else (view.position, view.velocity)
    )
    speed = math.hypot(velocity[0], velocity[1])
    if speed < _SLOW or (goal is not None and not leads_out(fence, here, goal[:2])):
        return ""
    swing = profile.hover_length * p["MPC_ACC_HOR"] / profile.gravity if view.load_attached else 0.0
    reach = (swing + speed * LATENCY) / speed
    end = (stop[0] + velocity[0] * reach, stop[1] + velocity[1] * reach)
    return leads_out(fence, here, end)


def leads_out(fence: Fence, start: Triple, end: Place) -> str:
    """Why the straight way from a position to a place leads out of the fence, or an empty string."""
    for number, zone in enumerate(fence.zones):
        if not zone.inclusion and crosses(zone, start[:2], end):
            return f"exclusion zone {number} of the geofence"
    for i in range(1, _SAMPLES + 1):
        share = i / _SAMPLES
        x, y = (a + share * (b - a) for a, b in zip(start[:2], end, strict=True))
        if fault := fence.outside((x, y, fence.home[2])):
            return fault
    return ""
