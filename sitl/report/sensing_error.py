"""How far off a vehicle's sensors may put its load: a pure function of the description."""

from __future__ import annotations

import math

from sitl_bridge.vehicle.sensors import Gps, Sensors

STANDARD_DEVIATIONS = 3.0
WANDERS = 1.5
"""Wanders of the receiver that the load may stray by, with the receiver."""


def sensing_error(sensors: Sensors, feedback: str) -> float:
    """Distance, m, within which the load can be held on these sensors; 0 when it is flown on the truth.

    Three standard deviations of a position that is measured with white noise and integrated from a velocity
    that is measured with white noise: the steady state of that Kalman filter has a variance of
    sigma_position * sigma_velocity * period an axis. On top of it 1.5 times the wander, which no filter sees.
    """
    if feedback == "truth":
        return 0.0
    gps: Gps = sensors.gps
    averaged = (
        2.0 * gps.horizontal_noise * gps.horizontal_velocity_noise
        + gps.vertical_noise * gps.vertical_velocity_noise
    ) / gps.rate
    wander = math.sqrt(2.0 * gps.horizontal_wander**2 + gps.vertical_wander**2)
    return STANDARD_DEVIATIONS * math.sqrt(averaged) + WANDERS * wander
