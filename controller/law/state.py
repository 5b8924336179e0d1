"""Names for the numbers of the autopilot's state: the order of eq. 31.

World ENU, body FLU, SI units; roll, pitch, yaw for R = Rz(yaw)·Ry(pitch)·Rx(roll).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

VEHICLE_POSITION = slice(0, 3)
LOAD_POSITION = slice(3, 6)
VEHICLE_VELOCITY = slice(6, 9)
LOAD_VELOCITY = slice(9, 12)
BODY_RATES = slice(12, 15)
EULER_ANGLES = slice(15, 18)
STATE_SIZE = 18
OWN_STATES = (0, 1, 2, 6, 7, 8, 12, 13, 14, 15, 16, 17)
"""Indices of the states that are the vehicle's own, none of the load's."""

WRENCH_SIZE = 4
"""Inputs u = [total thrust (N), moments about body x, y, z (N m)]."""
LONGEST_DELAY = 64
"""Most ticks of loop delay that a design can predict over."""
