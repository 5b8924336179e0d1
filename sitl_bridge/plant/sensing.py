"""Ideal sensors: what the accelerometer, gyroscope, magnetometer, barometer and GPS would measure."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sitl_bridge.compiled import Buffer, entry_point
from sitl_bridge.frames import Triple, rotate_inverse
from sitl_bridge.plant.dynamics import derivative
from sitl_bridge.plant.parameters import MOST_ROTORS, PARAMETERS
from sitl_bridge.plant.state import STATE_SIZE, VEHICLE_POSITION, VEHICLE_VELOCITY, Array

MEASUREMENT = np.dtype(
    [
        ("accelerometer", "f8", 3),  # specific force, m/s², body FLU
        ("gyroscope", "f8", 3),  # rad/s, body FLU
        ("magnetometer", "f8", 3),  # T, body FLU
        ("pressure", "f8"),  # Pa
        ("differential_pressure", "f8"),  # Pa
        ("pressure_altitude", "f8"),  # m
        ("temperature", "f8"),  # deg C
    ]
)

GPS_RATE_HZ = 10.0

# International Standard Atmosphere, troposphere.
SEA_LEVEL_PRESSURE = 101325.0  # Pa
SEA_LEVEL_TEMPERATURE = 288.15  # K
LAPSE_RATE = 6.5e-3  # K/m
PRESSURE_EXPONENT = 5.255877
ZERO_CELSIUS = 273.15  # K

# The Earth's field at the default home (World Magnetic Model, 2025): T, ENU.
MAGNETIC_FIELD: Triple = (1.25e-6, 21.4e-6, -43.3e-6)


class GpsFix(NamedTuple):
    """One GPS solution: m and m/s in the local ENU frame, accuracies in m."""

    position: Triple
    velocity: Triple
    horizontal_accuracy: float
    vertical_accuracy: float
    fix_type: int = 3
    satellites: int = 12


@entry_point(
    Buffer(PARAMETERS, (1,)),
    Buffer(np.float64, (STATE_SIZE,)),
    Buffer(np.float64, (MOST_ROTORS,)),
    Buffer(np.float64, (6,)),
    Buffer(np.float64, (STATE_SIZE,)),
    Buffer(MEASUREMENT, (1,)),
    int,
    float,
)
def measure(
    parameters: Any,
    x: Array,
    rotor_speed: Array,
    force: Array,
    scratch: Array,
    measurements: Any,
    held: int,
    home_altitude: float,
) -> int:
    """Fill measurements[0] from the state x; a held vehicle measures as if it stood.

    rotor_speed (n,) rad/s and force (6,) N are what acts now; home_altitude: m above mean sea level.
    """
    p, out = parameters[0], measurements[0]
    q = (x[6], x[7], x[8], x[9])
    derivative(p, x, rotor_speed, force, scratch)
    specific_force = (scratch[3], scratch[4], scratch[5] + p.gravity)
    if held:
        specific_force = (0.0, 0.0, p.gravity)
    specific_force = rotate_inverse(q, specific_force)
    field = rotate_inverse(q, MAGNETIC_FIELD)
    for i in range(3):
        out.accelerometer[i] = specific_force[i]
        out.gyroscope[i] = 0.0 if held else x[10 + i]
        out.magnetometer[i] = field[i]
    altitude = home_altitude + x[2]
    temperature = SEA_LEVEL_TEMPERATURE - LAPSE_RATE * altitude
    out.pressure = SEA_LEVEL_PRESSURE * (temperature / SEA_LEVEL_TEMPERATURE) ** PRESSURE_EXPONENT
    out.pressure_altitude = altitude
    out.temperature = temperature - ZERO_CELSIUS
    return 0


def gps_fix(x: Array) -> GpsFix:
    """A fix without error from the state x."""
    position: Any = tuple(x[VEHICLE_POSITION].tolist())
    velocity: Any = tuple(x[VEHICLE_VELOCITY].tolist())
    return GpsFix(position, velocity, horizontal_accuracy=0.1, vertical_accuracy=0.1)
