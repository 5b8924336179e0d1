"""How far off a vehicle's sensors may put its load: a pure function of the description."""

from __future__ import annotations

import math

from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.sensors import Gps

STANDARD_DEVIATIONS = 2.5
"""Of the distance in a plane: two moments in a thousand lie further out."""
WANDERS = 1.5
"""Wanders of the receiver that the load may stray by, with the receiver."""


def sensing_error(vehicle: Vehicle, feedback: str, rate_hz: float) -> float:
    """Distance, m, within which the load can be held on these sensors; 0 when it is flown on the truth.

    2.5 standard deviations of the vehicle's place and of the load's place below it, the best that a linear
    filter can do (`riccati_bound`). On top of it 1.5 times the receiver's wander, which no filter sees.
    """
    if feedback == "truth":
        return 0.0
    gps = vehicle.sensors.gps
    wander = math.sqrt(2.0 * gps.horizontal_wander**2 + gps.vertical_wander**2)
    variance = averaged_variance(gps) + _load_variance(vehicle, rate_hz)
    return STANDARD_DEVIATIONS * math.sqrt(variance) + WANDERS * wander


def averaged_variance(gps: Gps) -> float:
    """Variance, m², of a place from a receiver's fixes, averaged with its velocities.

    An axis whose position is measured with white noise, and integrated from a velocity that is measured with
    white noise, has sigma_position * sigma_velocity * period in that Kalman filter's steady state.
    """
    horizontal = 2.0 * gps.horizontal_noise * gps.horizontal_velocity_noise
    return (horizontal + gps.vertical_noise * gps.vertical_velocity_noise) / gps.rate


def _load_variance(vehicle: Vehicle, rate_hz: float) -> float:
    """Likewise of the load's place from the vehicle, m²: an angle's error times the cable's length."""
    from controller.estimator.riccati_bound import load_relative_bound
    from controller.feedback.estimate import tuning_for
    from sitl_bridge.vehicle.cable_law import linearised

    told = linearised(vehicle)
    try:
        bound = load_relative_bound(told, 1.0 / rate_hz, tuning_for(told, rate_hz))
    except (ValueError, ArithmeticError):  # no steady state: LinAlgError is a ValueError
        return 0.0
    return float(bound @ bound)
