"""Wire units, times and places that several messages share."""

from __future__ import annotations

import math

from controller.ground.flight.modes import Machine
from controller.ground.telemetry.vehicle_state import VehicleView
from sitl_bridge.frames import (
    DEG_E7_PER_DEG,
    MICROSECONDS_PER_SECOND,
    MILLIMETRES_PER_METRE,
    MILLISECONDS_PER_SECOND,
    Geodetic,
    Triple,
    euler_from_quaternion,
    flu_to_frd,
    heading_from_yaw,
    rotate_inverse,
)
from sitl_bridge.mavlink.fields import (
    whole,
)


def milliseconds(view: VehicleView) -> int:
    """Of the view's time, as 32 bits wrap it."""
    return int(view.time * MILLISECONDS_PER_SECOND) & 0xFFFFFFFF


def microseconds(view: VehicleView) -> int:
    """Of the view's time."""
    return whole(view.time * MICROSECONDS_PER_SECOND, 64, signed=False)


def place(machine: Machine, position: Triple) -> tuple[int, int, int]:
    """Latitude and longitude in degrees times 1e7, altitude above mean sea level in mm."""
    point = machine.profile.origin.geodetic(position)
    return wire_place(point)


def wire_place(point: Geodetic) -> tuple[int, int, int]:
    """Latitude and longitude in degrees times 1e7, altitude in mm."""
    return (
        whole(point.latitude * DEG_E7_PER_DEG, 32),
        whole(point.longitude * DEG_E7_PER_DEG, 32),
        whole(point.altitude * MILLIMETRES_PER_METRE, 32),
    )


def above_home(machine: Machine, height: float) -> float:
    """m, of a height above the world's origin."""
    return height - (machine.home[2] if machine.home is not None else 0.0)


def heading(view: VehicleView) -> float:
    """Compass heading, rad, 0..2π."""
    return heading_from_yaw(euler_from_quaternion(view.attitude)[2]) % (2 * math.pi)


def rates(view: VehicleView) -> Triple:
    """Body rates, rad/s, FRD."""
    return flu_to_frd(view.body_rates)


def in_body(view: VehicleView) -> Triple:
    """Velocity, m/s, FLU."""
    return rotate_inverse(view.attitude, view.velocity)
