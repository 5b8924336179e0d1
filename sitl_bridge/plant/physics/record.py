"""The plant's world as one record: all that compiled code reads and writes in a tick, by name."""

from __future__ import annotations

import numpy as np

from sitl_bridge.plant.physics.disturbance import HELD
from sitl_bridge.plant.physics.dynamics import WORK_SHAPE
from sitl_bridge.plant.physics.parameters import PARAMETERS
from sitl_bridge.plant.physics.state import INNER_SIZE, MOST_ROTORS, REACTIONS_SIZE, STATE_SIZE
from sitl_bridge.plant.sensors.instruments import INSTRUMENTS, MEASUREMENT

SCHEDULE = np.dtype(
    [
        ("steps", "i8"),  # integration steps of a tick
        ("step", "f8"),  # s
        ("force_hold", "i8"),  # steps that a row of the table of forces acts
        ("wind_hold", "i8"),  # likewise
        ("home_altitude", "f8"),  # m above mean sea level
    ]
)
"""What stays the same from tick to tick."""

WORLD = np.dtype(
    [
        ("parameters", PARAMETERS, (1,)),
        ("schedule", SCHEDULE),
        ("state", "f8", STATE_SIZE),  # see `state`, likewise the inner state
        ("inner", "f8", INNER_SIZE),
        ("controls", "f8", MOST_ROTORS),  # 0..1, as commanded
        ("speed_share", "f8", MOST_ROTORS),  # of the commanded speed that a rotor reaches; 1: it is sound
        ("rotor_speed", "f8", MOST_ROTORS),  # rad/s, as commanded
        ("force", HELD),  # N, external, on vehicle and load, world
        ("wind", HELD),  # m/s, at vehicle and load, world
        ("work", "f8", WORK_SHAPE),  # scratch of the integrator
        ("magnetic_field", "f8", 3),  # T, ENU
        ("reactions", "f8", REACTIONS_SIZE),  # see `state`
        ("truth", MEASUREMENT, (1,)),  # what ideal sensors would read
        ("instruments", INSTRUMENTS, (1,)),
    ],
    align=True,
)
"""One record of the world."""
