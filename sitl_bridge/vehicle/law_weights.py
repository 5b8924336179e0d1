"""Factors on the weights of the shipped designs."""

from __future__ import annotations

from typing import Any

from sitl_bridge.vehicle.schema import Section, quantity


def _factor(what: str) -> Any:
    return quantity("-", f"factor on the weight of {what}", 1.0, ge=1e-3, le=1e3)


class LawWeights(Section):
    """Factors on the weights in a design's quadratic cost, eq. 53; what a design does not weigh stays so.

    Under ground control the LQR_* parameters come on top.
    """

    vehicle_position: float = _factor("the vehicle's position")
    load_position: float = _factor("the load's position")
    vehicle_velocity: float = _factor("the vehicle's velocity")
    load_velocity: float = _factor("the load's velocity")
    body_rates: float = _factor("the body rates")
    attitude: float = _factor("roll, pitch and yaw")
    integral: float = _factor("the integral of the load's position error")
    thrust: float = _factor("thrust")
    moments: float = _factor("the moments")
