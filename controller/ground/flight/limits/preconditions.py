"""What has to be true before the vehicle can be armed, and what to say when it is not."""

from __future__ import annotations

import math

from controller.ground.flight.limits.fence import Fence
from controller.ground.parameters.protocol import Parameters
from controller.ground.telemetry.vehicle_state import VehicleView


def tilt(view: VehicleView) -> float:
    """Angle between the body's z axis and the vertical, rad."""
    _, x, y, _ = view.attitude
    return math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y))))


def arming_faults(view: VehicleView | None, parameters: Parameters, fence: Fence | None) -> list[str]:
    """Why the vehicle cannot be armed now; empty if it can."""
    if view is None or math.isinf(view.hil_age):
        return ["no sensor data yet; start the plant"]
    if not view.estimated:
        return ["the vehicle fell over; restart the plant"]
    faults = []
    if not view.hil_age < parameters["COM_HIL_LOSS_T"]:  # less is a busy machine, which soon goes on
        faults.append(f"no sensor data for {view.hil_age:.1f} s; is the plant running?")
    faults += [f"{name} not ready; wait, or see SYS_STATUS" for name in unhealthy(view)]
    if not view.in_reach:
        return [*faults, "the state is beyond all bounds; restart the plant"]
    speed = _speed(view)
    if speed > parameters["COM_ARM_SPEED"]:
        faults.append(f"not at rest ({speed:.2f} m/s); wait, or raise COM_ARM_SPEED")
    angle = math.degrees(tilt(view))
    if angle > parameters["COM_ARM_TILT"]:
        faults.append(f"tilted by {angle:.0f} deg; level it, or raise COM_ARM_TILT")
    if view.battery_remaining < parameters["COM_ARM_BAT_MIN"]:
        faults.append(f"battery at {100 * view.battery_remaining:.0f} %; charge it, or lower COM_ARM_BAT_MIN")
    outside = fence.outside(view.position) if fence is not None else ""
    return [*faults, outside] if outside else faults


def has_settled(view: VehicleView, parameters: Parameters) -> bool:
    """Whether every sensor and estimate is good and shows a vehicle at rest, as at arming."""
    return not unhealthy(view) and view.in_reach and _speed(view) <= parameters["COM_ARM_SPEED"]


def _speed(view: VehicleView) -> float:
    """Of the faster body, m/s."""
    return max(math.hypot(*view.velocity), math.hypot(*view.load_velocity))


def unhealthy(view: VehicleView) -> list[str]:
    """Names of the sensors and estimates that are not good."""
    health = view.health
    return [
        name
        for name, good in (
            ("gyroscope", health.gyroscope),
            ("accelerometer", health.accelerometer),
            ("magnetometer", health.magnetometer),
            ("barometer", health.barometer),
            ("GPS", health.gps),
            ("attitude estimate", health.attitude),
            ("position estimate", health.position),
            ("load estimate", health.load),
        )
        if not good
    ]
