"""Names for the numbers of the plant's state: one flat vector, so that it integrates and logs as it is.

World ENU, body FLU, SI units; the attitude quaternion (w, x, y, z) rotates body vectors into the world.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.frames import quaternion_from_euler
from sitl_bridge.vehicle import Vehicle

Array = NDArray[np.float64]

VEHICLE_POSITION = slice(0, 3)
VEHICLE_VELOCITY = slice(3, 6)
ATTITUDE = slice(6, 10)
BODY_RATES = slice(10, 13)
LOAD_POSITION = slice(13, 16)
LOAD_VELOCITY = slice(16, 19)
STATE_SIZE = 19

COLUMNS = (
    *(f"vehicle_{axis}_m" for axis in "xyz"),
    *(f"vehicle_v{axis}_m_s" for axis in "xyz"),
    *(f"attitude_q{part}" for part in "wxyz"),
    *(f"body_rate_{axis}_rad_s" for axis in "pqr"),
    *(f"load_{axis}_m" for axis in "xyz"),
    *(f"load_v{axis}_m_s" for axis in "xyz"),
)
"""Log column of each element of the state, in order."""


def initial_state(vehicle: Vehicle) -> Array:
    """The state (19,) that the description starts from."""
    state = np.zeros(STATE_SIZE)
    state[VEHICLE_POSITION] = vehicle.initial_vehicle_position
    state[VEHICLE_VELOCITY] = vehicle.initial.vehicle_velocity
    state[ATTITUDE] = quaternion_from_euler(vehicle.initial.attitude)
    state[BODY_RATES] = vehicle.initial.body_rates
    state[LOAD_POSITION] = vehicle.initial.load_position
    state[LOAD_VELOCITY] = vehicle.initial.load_velocity
    return state
