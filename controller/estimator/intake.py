"""From the sensors of a tick, as the HIL link has them, to the filter's input; compiled."""

from __future__ import annotations

from typing import Any

from controller.estimator.records import INPUT
from controller.hil.ticks import SENSED
from sitl_bridge.compiled import Buffer, entry_point


@entry_point(Buffer(SENSED, (1,)), Buffer(INPUT, (1,)))
def give(sensed: Any, given: Any) -> int:
    """Copy what is new: inertial sensors, magnetic field and altitude."""
    s, g = sensed[0], given[0]
    for axis in range(3):
        g.accelerometer[axis] = s.accelerometer[axis]
        g.gyroscope[axis] = s.gyroscope[axis]
        g.magnetometer[axis] = s.magnetometer[axis]
    g.altitude = s.altitude
    g.has_imu = s.has_imu
    g.has_magnetometer = s.has_magnetometer
    g.has_altitude = s.has_altitude
    return 0
