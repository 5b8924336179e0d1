"""The vehicle description as one flat record that compiled code reads by name."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.vehicle import Vehicle

MOST_ROTORS = 16  # as many as HIL_ACTUATOR_CONTROLS has controls

PARAMETERS = np.dtype(
    [
        ("gravity", "f8"),
        ("vehicle_mass", "f8"),
        ("inertia", "f8", 3),
        ("load_mass", "f8"),
        ("stiffness", "f8"),
        ("damping", "f8"),
        ("rest_length", "f8"),
        ("two_way", "b1"),
        ("rotor_count", "i8"),
        ("rotor_x", "f8", MOST_ROTORS),
        ("rotor_y", "f8", MOST_ROTORS),
        ("thrust_coefficient", "f8", MOST_ROTORS),
        ("reaction_coefficient", "f8", MOST_ROTORS),
        ("max_speed", "f8", MOST_ROTORS),
    ]
)

Parameters = NDArray[np.void]


def parameters(vehicle: Vehicle) -> Parameters:
    """A record array of shape (1,) with everything that the equations of motion need, SI units.

    `reaction_coefficient` is c_Q with the sign of the torque about body z (ccw rotors: negative, eq. 13).
    """
    record = np.zeros(1, dtype=PARAMETERS)
    p = record[0]
    p["gravity"] = vehicle.gravity
    p["vehicle_mass"] = vehicle.airframe.mass
    p["inertia"] = vehicle.airframe.inertia
    p["load_mass"] = vehicle.load.mass
    p["stiffness"] = vehicle.cable.stiffness
    p["damping"] = vehicle.cable.damping
    p["rest_length"] = vehicle.cable.rest_length
    p["two_way"] = vehicle.cable.model == "two-way"
    p["rotor_count"] = len(vehicle.rotors)
    for index, rotor in enumerate(vehicle.rotors):
        p["rotor_x"][index], p["rotor_y"][index], _ = rotor.position
        p["thrust_coefficient"][index] = rotor.thrust_coefficient
        sign = -1.0 if rotor.direction == "ccw" else 1.0
        p["reaction_coefficient"][index] = sign * rotor.torque_coefficient
        p["max_speed"][index] = rotor.max_speed
    return record
