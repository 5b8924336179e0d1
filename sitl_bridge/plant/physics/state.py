"""Names for the numbers of the plant's state: flat vectors, so that they integrate and log as they are.

World ENU, body FLU, SI units; the attitude quaternion (w, x, y, z) rotates body vectors into the world.
The state proper is what the equations of motion integrate. The inner state is what else a body remembers:
rotor speeds (their lag has an exact solution), where contacts stick to the ground, whether the cable holds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.frames import quaternion_from_euler, rotate
from sitl_bridge.ids import ACTUATOR_CONTROLS
from sitl_bridge.vehicle.cable_law import BRANCHES
from sitl_bridge.vehicle.chain import MOST_SEGMENTS, node_shares
from sitl_bridge.vehicle.description import Vehicle, hover_rotor_speeds

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

MOST_ROTORS = ACTUATOR_CONTROLS
STOPPED = np.zeros(MOST_ROTORS)
"""Controls of rotors at rest."""
LEG_LANES = 4
"""Legs are worked out so many at a time."""
LEG_BLOCKS = 2
MOST_LEGS = LEG_BLOCKS * LEG_LANES
LOAD_CONTACT = MOST_LEGS  # number of the load's contact, after those of the legs
CONTACTS = MOST_LEGS + 1

# The inner state: rotor speeds (rad/s) come first.
ANCHOR_EAST = MOST_ROTORS
ANCHOR_NORTH = ANCHOR_EAST + CONTACTS
"""m, world: the point of the ground that each contact sticks to; east of all contacts, then north."""
CABLE_HOLDS = ANCHOR_NORTH + CONTACTS
"""1 while the cable joins vehicle and load, 0 once it has broken or let go."""
CABLE_STATE = CABLE_HOLDS + 1
"""The first of what a cable remembers that is more than a spring and damper, see `flexible_cable`."""
MOST_CABLE_STATES = 6 * (MOST_SEGMENTS - 1)
INNER_SIZE = CABLE_STATE + MOST_CABLE_STATES

SPECIFIC_FORCE = slice(0, 3)
"""m/s², body FLU: what an accelerometer at the centre of mass feels; cable, drag and ground included."""
ANGULAR_ACCELERATION = slice(3, 6)
"""rad/s², body FLU."""
TENSION = 6
"""N, of the cable."""
VEHICLE_GROUND_FORCE = 7
"""N, normal, of the ground on all legs."""
LOAD_GROUND_FORCE = 8
"""N, normal, of the ground on the load."""
REACTIONS_SIZE = 9


def initial_state(vehicle: Vehicle) -> Array:
    """The state (19,) that the description starts from."""
    state = np.zeros(STATE_SIZE)
    state[VEHICLE_POSITION] = vehicle.initial_vehicle_position
    state[VEHICLE_VELOCITY] = vehicle.initial.vehicle_velocity
    state[ATTITUDE] = quaternion_from_euler(vehicle.initial.attitude)
    state[BODY_RATES] = vehicle.initial.body_rates
    state[LOAD_POSITION] = vehicle.initial_load_position
    state[LOAD_VELOCITY] = vehicle.initial.load_velocity
    return state


def initial_inner_state(vehicle: Vehicle) -> Array:
    """The inner state (149,) at the start: rotors at hover speed in the air and still on the ground."""
    inner = np.zeros(INNER_SIZE)
    if vehicle.initial.start == "hover":
        inner[: len(vehicle.rotors)] = hover_rotor_speeds(vehicle)
    x, y, _ = vehicle.initial_vehicle_position
    attitude = quaternion_from_euler(vehicle.initial.attitude)
    for index, leg in enumerate(vehicle.airframe.legs):
        offset = rotate(attitude, leg)
        inner[ANCHOR_EAST + index], inner[ANCHOR_NORTH + index] = x + offset[0], y + offset[1]
    inner[ANCHOR_EAST + LOAD_CONTACT], inner[ANCHOR_NORTH + LOAD_CONTACT] = vehicle.initial_load_position[:2]
    inner[CABLE_HOLDS] = 1.0
    if not vehicle.cable.is_linear:  # it has relaxed
        strain = vehicle.initial_length / vehicle.cable.rest_length - 1.0
        inner[CABLE_STATE : CABLE_STATE + BRANCHES] = max(strain, 0.0)
    if vehicle.cable.is_chain:
        top, bottom = np.array(vehicle.initial_vehicle_position), np.array(vehicle.initial_load_position)
        for index, share in enumerate(node_shares(vehicle)):
            first = CABLE_STATE + 6 * index
            inner[first : first + 3] = top + share * (bottom - top)
            inner[first + 3 : first + 6] = np.array(vehicle.initial.vehicle_velocity) * (1.0 - share)
            inner[first + 3 : first + 6] += np.array(vehicle.initial.load_velocity) * share
    return inner
