"""What is observed of a flight: the true state, or what the sensors say. Flat vectors; SI units."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from controller.law.state import Array
from sitl.gym.plant import RATE_HZ, GymPlant
from sitl_bridge.plant.physics.state import (
    ATTITUDE,
    BODY_RATES,
    LOAD_POSITION,
    LOAD_VELOCITY,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
)

LARGEST = 1e4
"""Bound of every component; a flight that goes so far is over."""
EARTH_FIELD = 5e-5
"""T, in which the magnetometer is observed."""
OLDEST = 10.0
"""s: a fix or sighting that is older, or that there is none of."""

TRUTH_NAMES = (
    *(f"target_minus_load_{axis}_m" for axis in "xyz"),
    *(f"load_v{axis}_m_s" for axis in "xyz"),
    *(f"load_minus_vehicle_{axis}_m" for axis in "xyz"),
    *(f"vehicle_v{axis}_m_s" for axis in "xyz"),
    *(f"rotation_{row}{column}" for row in "xyz" for column in "xyz"),
    *(f"body_rate_{axis}_rad_s" for axis in "pqr"),
)
"""World ENU; the rotation takes body FLU to the world."""
SENSOR_NAMES = (
    *(f"target_minus_fix_{axis}_m" for axis in "xyz"),
    *(f"fix_v{axis}_m_s" for axis in "xyz"),
    "fix_age_s",
    *(f"specific_force_{axis}_m_s2" for axis in "xyz"),
    *(f"gyroscope_{axis}_rad_s" for axis in "pqr"),
    *(f"magnetometer_{axis}" for axis in "xyz"),
    "target_minus_barometer_m",
    *(f"sighting_{axis}_m" for axis in "xyz"),
    "sighting_age_s",
)
"""Fixes of the vehicle, world ENU; the rest in body FLU. The sighting is the load from the vehicle."""


def truth(plant: GymPlant, target: Array) -> Array:
    """(24,), `TRUTH_NAMES`."""
    x = plant.state
    return np.concatenate(
        [
            target - x[LOAD_POSITION],
            x[LOAD_VELOCITY],
            x[LOAD_POSITION] - x[VEHICLE_POSITION],
            x[VEHICLE_VELOCITY],
            rotation(x[ATTITUDE]).ravel(),
            x[BODY_RATES],
        ]
    )


def sensors(plant: GymPlant, target: Array) -> Array:
    """(21,), `SENSOR_NAMES`."""
    sensed = plant.sensed[0]
    position, velocity = plant.fix or (np.zeros(3), np.zeros(3))
    seen = plant.sighting or (0.0, 0.0, 0.0)
    fix_age = OLDEST if plant.fix is None else plant.ticks_since_fix / RATE_HZ
    age = OLDEST if plant.sighting is None else plant.ticks_since_sighting / RATE_HZ
    return np.concatenate(
        [
            target - position,
            velocity,
            [min(OLDEST, fix_age)],
            sensed["accelerometer"],
            sensed["gyroscope"],
            sensed["magnetometer"] / EARTH_FIELD,
            [target[2] + plant.vehicle.home.altitude - sensed["altitude"]],
            seen,
            [min(OLDEST, age)],
        ]
    )


OBSERVATIONS: dict[str, tuple[Callable[[GymPlant, Array], Array], tuple[str, ...]]] = {
    "truth": (truth, TRUTH_NAMES),
    "sensors": (sensors, SENSOR_NAMES),
}
"""By name: what makes the vector, and what its components are."""


def rotation(quaternion: Array) -> NDArray[np.float64]:
    """(3, 3) from a unit quaternion (w, x, y, z)."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
