"""The paper's equations of motion a second time, to check the plant against.

It shares nothing with `sitl_bridge.plant` but the vehicle description: the world is NED and the body FRD;
the attitude is Euler angles (yaw, pitch, roll: 3-2-1), singular at a pitch of 90 degrees; the vehicle's
velocity is in body axes, so that Newton's law carries the transport term; forces and moments are vectors,
the rotors' moments cross products; and an adaptive method of eighth order (DOP853) integrates to 1e-10.
Equation numbers are the paper's, as corrected.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from sitl_bridge.vehicle.description import Vehicle

Array = NDArray[np.float64]

NED_FROM_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FRD_FROM_FLU = np.diag([1.0, -1.0, -1.0])
DOWN = np.array([0.0, 0.0, 1.0])

# Where each quantity stands in the state (18,).
POSITION = slice(0, 3)  # of the vehicle, m, NED
BODY_VELOCITY = slice(3, 6)  # of the vehicle over ground, m/s, FRD
EULER = slice(6, 9)  # roll, pitch, yaw of FRD in NED, rad
RATES = slice(9, 12)  # p, q, r, rad/s, FRD
LOAD_POSITION = slice(12, 15)  # m, NED
LOAD_VELOCITY = slice(15, 18)  # m/s, NED


class Flight(NamedTuple):
    """What a simulation gives, back in the project's frames: ENU and FLU."""

    vehicle_position: Array  # (n, 3) m
    load_position: Array  # (n, 3) m
    attitude: Array  # (n, 3, 3), rotates FLU into ENU


def simulate(
    vehicle: Vehicle,
    rotor_speed: Sequence[float] | Array,
    times: Array,
    vehicle_force: Sequence[float] = (0.0, 0.0, 0.0),
    load_force: Sequence[float] = (0.0, 0.0, 0.0),
) -> Flight:
    """Fly from the description's initial state with the rotors held.

    rotor_speed: (rotors,) rad/s; times: (n,) s, from 0; forces: constant, N, ENU, on top of gravity.
    """
    speeds = np.asarray(rotor_speed, dtype=float)
    forces = NED_FROM_ENU @ vehicle_force, NED_FROM_ENU @ load_force
    solution = solve_ivp(
        lambda _, state: derivative(vehicle, state, speeds, *forces),
        (times[0], times[-1]),
        initial_state(vehicle),
        method="DOP853",
        t_eval=times,
        rtol=1e-10,
        atol=1e-10,
    )
    if not solution.success:
        raise RuntimeError(solution.message)
    states = solution.y.T
    return Flight(
        vehicle_position=states[:, POSITION] @ NED_FROM_ENU,
        load_position=states[:, LOAD_POSITION] @ NED_FROM_ENU,
        attitude=np.array([NED_FROM_ENU @ rotation(*s[EULER]) @ FRD_FROM_FLU for s in states]),
    )


def initial_state(vehicle: Vehicle) -> Array:
    """The description's initial state (18,) in NED and FRD."""
    start = vehicle.initial
    roll, pitch, yaw = start.attitude
    euler = np.array([roll, -pitch, np.pi / 2 - yaw])
    state = np.empty(18)
    state[POSITION] = NED_FROM_ENU @ vehicle.initial_vehicle_position
    state[BODY_VELOCITY] = rotation(*euler).T @ NED_FROM_ENU @ start.vehicle_velocity
    state[EULER] = euler
    state[RATES] = FRD_FROM_FLU @ start.body_rates
    state[LOAD_POSITION] = NED_FROM_ENU @ start.load_position
    state[LOAD_VELOCITY] = NED_FROM_ENU @ start.load_velocity
    return state


def derivative(
    vehicle: Vehicle, state: Array, rotor_speed: Array, on_vehicle: Array, on_load: Array
) -> Array:
    """Time derivative of the state (18,); rotor_speed: (rotors,) rad/s; external forces: (3,) N, NED."""
    body = rotation(*state[EULER])
    rates = state[RATES]
    velocity = body @ state[BODY_VELOCITY]
    inertia = np.array(vehicle.airframe.inertia)

    pull = cable_force(vehicle, state[LOAD_POSITION] - state[POSITION], state[LOAD_VELOCITY] - velocity)
    thrust, moment = rotor_wrench(vehicle, rotor_speed)
    weight = vehicle.airframe.mass * vehicle.gravity * DOWN
    force = thrust + body.T @ (weight + pull + on_vehicle)

    out = np.empty(18)
    out[POSITION] = velocity
    out[BODY_VELOCITY] = force / vehicle.airframe.mass - np.cross(rates, state[BODY_VELOCITY])  # eq. 3
    out[EULER] = euler_rates(state[EULER]) @ rates  # eqs. 49-51
    out[RATES] = (moment - np.cross(rates, inertia * rates)) / inertia  # eq. 10
    out[LOAD_POSITION] = state[LOAD_VELOCITY]
    out[LOAD_VELOCITY] = (on_load - pull) / vehicle.load.mass + vehicle.gravity * DOWN
    return out


def cable_force(vehicle: Vehicle, across: Array, across_rate: Array) -> Array:
    """Force of the cable on the vehicle (3,), N (eq. 9).

    across: (3,) from vehicle to load, m; across_rate: (3,) its rate, m/s.
    """
    cable = vehicle.cable
    length = np.linalg.norm(across)
    along = across / length
    tension = cable.stiffness * (length - cable.rest_length) + cable.damping * (along @ across_rate)
    if cable.model == "tension-only" and (length <= cable.rest_length or tension < 0):
        return np.zeros(3)
    force: Array = tension * along
    return force


def rotor_wrench(vehicle: Vehicle, rotor_speed: Array) -> tuple[Array, Array]:
    """Force (3,) N and moment (3,) N m of the rotors, FRD (eqs. 5 to 7, 12 and 13)."""
    force, moment = np.zeros(3), np.zeros(3)
    for rotor, speed in zip(vehicle.rotors, rotor_speed, strict=True):
        lift = -rotor.thrust_coefficient * speed**2 * DOWN
        force += lift
        # Seen from above, a rotor that turns anticlockwise turns the airframe clockwise: about +z, down.
        reaction = rotor.torque_coefficient * speed**2 * DOWN
        moment += np.cross(FRD_FROM_FLU @ rotor.position, lift)
        moment += reaction if rotor.direction == "ccw" else -reaction
    return force, moment


def rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Rz(yaw) Ry(pitch) Rx(roll) (eq. 2, corrected): rotates body axes into the world, (3, 3)."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    out: Array = about_z @ about_y @ about_x
    return out


def euler_rates(euler: Array) -> Array:
    """The matrix (3, 3) that takes p, q, r to the rates of roll, pitch and yaw (eqs. 49 to 51, corrected)."""
    roll, pitch, _ = euler
    s, c, t = np.sin(roll), np.cos(roll), np.tan(pitch)
    return np.array([[1, s * t, c * t], [0, c, -s], [0, s / np.cos(pitch), c / np.cos(pitch)]])
