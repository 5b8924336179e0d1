"""The truth that sensors measure: what ideal ones would read, from the state and what acts on it."""

from __future__ import annotations

from typing import Any

import numpy as np

from sitl_bridge.compiled import Buffer, entry_point
from sitl_bridge.frames import rotate_inverse
from sitl_bridge.plant.physics.dynamics import WORK_SHAPE, fill_reactions
from sitl_bridge.plant.physics.parameters import PARAMETERS
from sitl_bridge.plant.physics.state import INNER_SIZE, REACTIONS_SIZE, STATE_SIZE, Array
from sitl_bridge.plant.sensors.atmosphere import ZERO_CELSIUS, air_pressure, air_temperature
from sitl_bridge.plant.sensors.instruments import MEASUREMENT


@entry_point(
    Buffer(PARAMETERS, (1,)),
    Buffer(np.float64, (STATE_SIZE,)),
    Buffer(np.float64, (INNER_SIZE,)),
    Buffer(np.float64, (6,)),
    Buffer(np.float64, (6,)),
    Buffer(np.float64, WORK_SHAPE),
    Buffer(np.float64, (3,)),
    Buffer(np.float64, (REACTIONS_SIZE,)),
    Buffer(MEASUREMENT, (1,)),
    int,
    float,
)
def measure(
    parameters: Any,
    x: Array,
    inner: Array,
    force: Array,
    wind: Array,
    work: Array,
    magnetic_field: Array,
    reactions: Array,
    measurements: Any,
    held: int,
    home_altitude: float,
) -> int:
    """Fill reactions and measurements[0] from the state; a held vehicle measures as if it stood.

    inner: inner state; force (6,) N and wind (6,) m/s, world, are what acts now; magnetic_field: T, ENU;
    work: scratch; home_altitude: m above mean sea level.
    """
    p, out = parameters[0], measurements[0]
    q = (x[6], x[7], x[8], x[9])
    fill_reactions(p, x, inner, force, wind, work, reactions)
    standing = rotate_inverse(q, (0.0, 0.0, p.gravity))
    field = rotate_inverse(q, (magnetic_field[0], magnetic_field[1], magnetic_field[2]))
    for i in range(3):
        out.accelerometer[i] = standing[i] if held else reactions[i]
        out.gyroscope[i] = 0.0 if held else x[10 + i]
        out.magnetometer[i] = field[i]
    altitude = home_altitude + x[2]
    out.pressure = air_pressure(altitude)
    out.pressure_altitude = altitude
    out.temperature = air_temperature(altitude) - ZERO_CELSIUS
    return 0
