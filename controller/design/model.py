"""The linear model at hover: the Jacobian of the equations of motion, written down by hand.

States in the order of eq. 31, inputs [total thrust, M_x, M_y, M_z] (eq. 28 and Appendix F1).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from controller.law.state import LOAD_POSITION, OWN_STATES, STATE_SIZE, WRENCH_SIZE, Array
from sitl_bridge.vehicle.description import Vehicle


class LinearModel(NamedTuple):
    """x' = A x + B u, in deviations from hover; A (n, n), B (n, 4), n = 18 unless states are appended."""

    A: Array
    B: Array


def linear_model(vehicle: Vehicle, length: float | None = None, thrust: float | None = None) -> LinearModel:
    """Linearise vehicle and load hovering upright, the load straight below.

    length: cable length l in m, thrust: total thrust in N; both by default those of the equilibrium (eqs. 17
    and 19, corrected). With l = 2 and 196.2 N, which is no equilibrium, this is Appendix F1's printed matrix.
    """
    length = vehicle.hover_length if length is None else length
    thrust = vehicle.hover_thrust if thrust is None else thrust
    cable, vehicle_mass, load_mass = vehicle.cable, vehicle.airframe.mass, vehicle.load.mass
    # Sideways the cable is a pendulum's string under its tension, lengthways a spring and damper.
    string = cable.stiffness * (length - cable.rest_length) / length
    relative_stiffness = np.diag([string, string, cable.stiffness])
    relative_damping = np.diag([0.0, 0.0, cable.damping])

    a = np.zeros((STATE_SIZE, STATE_SIZE))
    a[0:3, 6:9] = np.eye(3)
    a[3:6, 9:12] = np.eye(3)
    for rows, mass, sign in ((slice(6, 9), vehicle_mass, 1.0), (slice(9, 12), load_mass, -1.0)):
        a[rows, 0:3] = -sign * relative_stiffness / mass
        a[rows, 3:6] = sign * relative_stiffness / mass
        a[rows, 6:9] = -sign * relative_damping / mass
        a[rows, 9:12] = sign * relative_damping / mass
    a[6:9, 6:9] -= np.eye(3) * vehicle.airframe.drag.linear / vehicle_mass
    a[9:12, 9:12] -= np.eye(3) * vehicle.load.drag.linear / load_mass
    a[6, 16] = thrust / vehicle_mass  # pitch tilts the thrust forward
    a[7, 15] = -thrust / vehicle_mass  # roll tilts it to the right
    a[15:18, 12:15] = np.eye(3)

    b = np.zeros((STATE_SIZE, WRENCH_SIZE))
    b[8, 0] = 1.0 / vehicle_mass
    b[12:15, 1:4] = np.diag(1.0 / np.array(vehicle.airframe.inertia))
    return LinearModel(a, b)


def unloaded_model(vehicle: Vehicle) -> LinearModel:
    """Linearise the vehicle alone, hovering upright: the 12 states that are its own, `OWN_STATES`."""
    model = linear_model(vehicle, thrust=vehicle.airframe.mass * vehicle.gravity)
    a = model.A[np.ix_(OWN_STATES, OWN_STATES)]
    a[3:6, 0:6] = 0.0  # no cable
    return LinearModel(a, model.B[list(OWN_STATES)])


def actuated_model(vehicle: Vehicle, loaded: bool = True) -> LinearModel:
    """The model at hover from the commanded wrench on: with the lag of the rotors, if they have one."""
    time_constant = rotor_time_constant(vehicle)
    model = linear_model(vehicle) if loaded else unloaded_model(vehicle)
    return with_rotor_lag(model, time_constant) if time_constant > 0.0 else model


SHORTEST_LAG = 1e-5
"""s, of rotors"""


def rotor_time_constant(vehicle: Vehicle) -> float:
    """Time constant of the wrench that the rotors give, s; 0 without lag, the mean where rotors differ.

    A lag of microseconds is none: it is far below any tick, and one cannot reckon with its inverse.
    Near hover thrust is linear in rotor speed, so the wrench lags its command as the speeds lag theirs.
    """
    mean = sum(rotor.time_constant for rotor in vehicle.rotors) / len(vehicle.rotors)
    return mean if mean >= SHORTEST_LAG else 0.0


def with_rotor_lag(model: LinearModel, time_constant: float) -> LinearModel:
    """Append the wrench that the rotors give as four states that follow the command with a first-order lag.

    time_constant: s, above 0. The inputs become the commanded wrench.
    """
    rigid = model.A.shape[0]
    size = rigid + WRENCH_SIZE
    a = np.zeros((size, size))
    a[:rigid, :rigid] = model.A
    a[:rigid, rigid:] = model.B
    a[rigid:, rigid:] = -np.eye(WRENCH_SIZE) / time_constant
    b = np.zeros((size, WRENCH_SIZE))
    b[rigid:] = np.eye(WRENCH_SIZE) / time_constant
    return LinearModel(a, b)


def with_integrator(model: LinearModel, position: slice = LOAD_POSITION) -> LinearModel:
    """Append the integral of a position, the load's, as three states (eq. 55, corrected)."""
    size = model.A.shape[0]
    a = np.zeros((size + 3, size + 3))
    a[:size, :size] = model.A
    a[size:, position] = np.eye(3)
    return LinearModel(a, np.vstack([model.B, np.zeros((3, WRENCH_SIZE))]))
