"""Equations of motion of vehicle and load (eqs. 3 and 10), and the integrator that advances them.

Compiled; pure functions of their arguments, except that results are written into arrays that the caller
gives, so that a step allocates nothing.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sitl_bridge.compiled import Buffer, entry_point, kernel
from sitl_bridge.plant.cable import tension
from sitl_bridge.plant.parameters import MOST_ROTORS, PARAMETERS
from sitl_bridge.plant.state import STATE_SIZE, Array


@kernel
def rotor_wrench(p: Any, rotor_speed: Array) -> tuple[float, float, float, float]:
    """Total thrust (N) and moments about the body's x, y, z (N m) of all rotors (eqs. 6 and 13).

    p: parameter record; rotor_speed: (n,) in rad/s.
    """
    thrust, roll, pitch, yaw = 0.0, 0.0, 0.0, 0.0
    for i in range(p.rotor_count):
        squared = rotor_speed[i] * rotor_speed[i]
        lift = p.thrust_coefficient[i] * squared
        thrust += lift
        roll += p.rotor_y[i] * lift
        pitch -= p.rotor_x[i] * lift
        yaw += p.reaction_coefficient[i] * squared
    return thrust, roll, pitch, yaw


@kernel
def derivative(p: Any, x: Array, rotor_speed: Array, force: Array, out: Array) -> None:
    """Time derivative of the state.

    p: parameter record; x: state (19,), see `state`; rotor_speed: (n,) in rad/s; force: (6,) external
    force on vehicle and on load, N, world; out: (19,), written.
    """
    vx, vy, vz = x[3], x[4], x[5]
    qw, qx, qy, qz = x[6], x[7], x[8], x[9]
    rate_p, rate_q, rate_r = x[10], x[11], x[12]
    wx, wy, wz = x[16], x[17], x[18]

    # The cable: e points from the vehicle to the load.
    ex, ey, ez = x[13] - x[0], x[14] - x[1], x[15] - x[2]
    length = (ex * ex + ey * ey + ez * ez) ** 0.5
    ex, ey, ez = ex / length, ey / length, ez / length
    rate = (wx - vx) * ex + (wy - vy) * ey + (wz - vz) * ez
    pull = tension(p, length, rate)

    thrust, roll, pitch, yaw = rotor_wrench(p, rotor_speed)

    out[0], out[1], out[2] = vx, vy, vz
    # Translation (eq. 3): the body's z axis in the world carries the thrust (eq. 7).
    lift = thrust / p.vehicle_mass
    tug = pull / p.vehicle_mass
    out[3] = 2.0 * (qx * qz + qw * qy) * lift + tug * ex + force[0] / p.vehicle_mass
    out[4] = 2.0 * (qy * qz - qw * qx) * lift + tug * ey + force[1] / p.vehicle_mass
    out[5] = (1.0 - 2.0 * (qx * qx + qy * qy)) * lift + tug * ez + force[2] / p.vehicle_mass - p.gravity
    # Attitude: q' = q (0, p, q, r) / 2.
    out[6] = -0.5 * (qx * rate_p + qy * rate_q + qz * rate_r)
    out[7] = 0.5 * (qw * rate_p + qy * rate_r - qz * rate_q)
    out[8] = 0.5 * (qw * rate_q + qz * rate_p - qx * rate_r)
    out[9] = 0.5 * (qw * rate_r + qx * rate_q - qy * rate_p)
    # Rotation (eq. 10).
    inertia_x, inertia_y, inertia_z = p.inertia[0], p.inertia[1], p.inertia[2]
    out[10] = (roll - (inertia_z - inertia_y) * rate_q * rate_r) / inertia_x
    out[11] = (pitch - (inertia_x - inertia_z) * rate_p * rate_r) / inertia_y
    out[12] = (yaw - (inertia_y - inertia_x) * rate_p * rate_q) / inertia_z
    out[13], out[14], out[15] = wx, wy, wz
    load_tug = pull / p.load_mass
    out[16] = -load_tug * ex + force[3] / p.load_mass
    out[17] = -load_tug * ey + force[4] / p.load_mass
    out[18] = -load_tug * ez + force[5] / p.load_mass - p.gravity


@kernel
def runge_kutta_4(p: Any, x: Array, rotor_speed: Array, force: Array, step: float, work: Array) -> None:
    """Advance the state by one fixed step of the classic fourth-order Runge-Kutta method, in place.

    step: s; work: (5, 19) scratch. The quaternion is brought back to unit length afterwards.
    """
    k1, k2, k3, k4, probe = work[0], work[1], work[2], work[3], work[4]
    half, sixth = 0.5 * step, step / 6.0
    derivative(p, x, rotor_speed, force, k1)
    for i in range(STATE_SIZE):
        probe[i] = x[i] + half * k1[i]
    derivative(p, probe, rotor_speed, force, k2)
    for i in range(STATE_SIZE):
        probe[i] = x[i] + half * k2[i]
    derivative(p, probe, rotor_speed, force, k3)
    for i in range(STATE_SIZE):
        probe[i] = x[i] + step * k3[i]
    derivative(p, probe, rotor_speed, force, k4)
    for i in range(STATE_SIZE):
        x[i] += sixth * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
    norm = math.sqrt(x[6] * x[6] + x[7] * x[7] + x[8] * x[8] + x[9] * x[9])
    for i in range(6, 10):
        x[i] /= norm


FORCE_ROWS = 1024
"""Rows of the table of held forces that `advance` reads."""


@entry_point(
    Buffer(PARAMETERS, (1,)),
    Buffer(np.float64, (STATE_SIZE,)),
    Buffer(np.float64, (MOST_ROTORS,)),
    Buffer(np.float64, (FORCE_ROWS, 6)),
    Buffer(np.float64, (5, STATE_SIZE)),
    int,
    int,
    int,
    float,
)
def advance(
    record: Any,
    x: Array,
    rotor_speed: Array,
    forces: Array,
    work: Array,
    first_step: int,
    hold_steps: int,
    steps: int,
    step: float,
) -> int:
    """Advance the state x by `steps` steps of `step` seconds with the rotors held, in place.

    forces: N, world, on vehicle and load; row k acts from step k·hold_steps on; work: scratch.
    first_step: number of the first step, counted from row 0 of `forces`. Returns the next step's number.
    """
    p = record[0]
    for index in range(first_step, first_step + steps):
        runge_kutta_4(p, x, rotor_speed, forces[index // hold_steps], step, work)
    return first_step + steps
