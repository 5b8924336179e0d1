"""Whether a sensor is alive: it then has noise in every sample, and no motion is as rough as garbage."""

from __future__ import annotations

import math
from typing import Any

from controller.estimator.records import (
    ACCELEROMETER,
    FLYING,
    MAGNETOMETER,
    Filter,
)
from sitl_bridge.compiled import kernel

STALE_SAMPLES = 50
"""So many identical samples, and a sensor counts as stuck: a live one has noise in every sample."""


STALE_INERTIAL_SAMPLES = 5
"""The same in flight for accelerometer and gyroscope, on which the next samples of the flight depend."""


ROUGH = 40.0
"""Of a live inertial sensor's own noise: what changes from sample to sample so much more is garbage."""


ROUGHNESS_BLEND = 0.2


ROUGHEST = 100.0
"""A single jump, however far, is a knock."""


LEAST_ACCELEROMETER_NOISE, LEAST_GYROSCOPE_NOISE = 0.3, 0.015
"""m/s², rad/s: a quieter one would be rough wherever the cable snatches."""


@kernel
def note_sample(f: Filter, sensor: int, measured: Any) -> bool:
    """Compare a sample with those before; whether the sensor has failed."""
    m, same, roughest = f.m, True, 0.0
    for axis in range(3):
        change = measured[axis] - m.last_sample[sensor, axis]
        same = same and not abs(change) > 1e-9 * abs(measured[axis])
        roughest = max(roughest, abs(change - m.last_change[sensor, axis]))
        m.last_sample[sensor, axis], m.last_change[sensor, axis] = measured[axis], change
    m.stale_count[sensor] = m.stale_count[sensor] + 1 if same else 0
    if sensor != MAGNETOMETER:
        least = LEAST_ACCELEROMETER_NOISE if sensor == ACCELEROMETER else LEAST_GYROSCOPE_NOISE
        # A second difference of white noise has the standard deviation sqrt(1 + 4 + 1).
        roughest /= math.sqrt(6.0) * max(f.p.sensor_std[sensor], least)
        if not roughest < ROUGHEST:  # also where it is not a number
            roughest = ROUGHEST
        m.roughness[sensor] += ROUGHNESS_BLEND * (roughest - m.roughness[sensor])
    return failed(f, sensor)


@kernel
def failed(f: Filter, sensor: int) -> bool:
    """Whether a sensor repeats itself or, an inertial one, shows garbage; at rest they may repeat."""
    m = f.m
    if sensor == MAGNETOMETER:
        return bool(m.stale_count[sensor] >= STALE_SAMPLES)
    return bool(
        m.vehicle_mode == FLYING
        and (m.stale_count[sensor] >= STALE_INERTIAL_SAMPLES or m.roughness[sensor] > ROUGH)
    )
