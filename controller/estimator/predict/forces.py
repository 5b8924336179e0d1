"""What acts on vehicle and load: the cable, drag in still air, the rotors as they are commanded."""

from __future__ import annotations

import math
from typing import Any

from controller.estimator.records import (
    LOAD_DROPPED,
    LOAD_RELEASED,
    X_LOAD,
    X_LOAD_VELOCITY,
    Array,
    Filter,
)
from sitl_bridge.compiled import kernel


@kernel
def cable(f: Filter, jacobian: Array) -> tuple[float, float, float]:
    """The cable's force on the vehicle, N, world; writes its derivatives.

    F = T e with T = k_a (l - l_0) + c_a d(l - l_0)/dt (eq. 9, corrected), e from vehicle to load; a winch
    changes l_0.
    jacobian: (18,) written: dF/d(load position) and dF/d(load velocity), 3x3 by rows; zero when slack.
    """
    p, x = f.p, f.x
    for i in range(18):
        jacobian[i] = 0.0
    f.m.tension = 0.0
    if f.m.load_mode in (LOAD_RELEASED, LOAD_DROPPED):
        return 0.0, 0.0, 0.0
    rx, ry, rz = x[X_LOAD], x[X_LOAD + 1], x[X_LOAD + 2]
    sx, sy, sz = x[X_LOAD_VELOCITY], x[X_LOAD_VELOCITY + 1], x[X_LOAD_VELOCITY + 2]
    length = math.sqrt(rx * rx + ry * ry + rz * rz) + 1e-9
    ex, ey, ez = rx / length, ry / length, rz / length
    rate = sx * ex + sy * ey + sz * ez
    extension = length - p.rest_length
    tension = p.stiffness * extension + p.damping * (rate - p.reel_rate)
    if not p.two_way and (extension <= 0.0 or tension <= 0.0):
        return 0.0, 0.0, 0.0
    f.m.tension = tension
    along = p.damping / length
    gx = p.stiffness * ex + along * (sx - rate * ex)
    gy = p.stiffness * ey + along * (sy - rate * ey)
    gz = p.stiffness * ez + along * (sz - rate * ez)
    across = tension / length
    jacobian[0] = ex * gx + across * (1.0 - ex * ex)
    jacobian[1] = ex * gy - across * ex * ey
    jacobian[2] = ex * gz - across * ex * ez
    jacobian[3] = ey * gx - across * ey * ex
    jacobian[4] = ey * gy + across * (1.0 - ey * ey)
    jacobian[5] = ey * gz - across * ey * ez
    jacobian[6] = ez * gx - across * ez * ex
    jacobian[7] = ez * gy - across * ez * ey
    jacobian[8] = ez * gz + across * (1.0 - ez * ez)
    jacobian[9] = p.damping * ex * ex
    jacobian[10] = p.damping * ex * ey
    jacobian[11] = p.damping * ex * ez
    jacobian[12] = jacobian[10]
    jacobian[13] = p.damping * ey * ey
    jacobian[14] = p.damping * ey * ez
    jacobian[15] = jacobian[11]
    jacobian[16] = jacobian[14]
    jacobian[17] = p.damping * ez * ez
    return tension * ex, tension * ey, tension * ez


@kernel
def drag_rate(coefficients: Any, mass: float, vx: float, vy: float, vz: float) -> float:
    """Drag in still air as a rate, 1/s: the deceleration is this times the velocity (m/s)."""
    if coefficients[0] == 0.0 and coefficients[1] == 0.0:
        return 0.0
    return float((coefficients[0] + coefficients[1] * math.sqrt(vx * vx + vy * vy + vz * vz)) / mass)


@kernel
def rotors(f: Filter, elapsed: float, wrench: Array) -> None:
    """Advance the rotors by `elapsed` s towards the command under way; write the mean wrench meanwhile.

    First-order lag in speed; thrust and torque go with its square, averaged exactly over the interval by
    Simpson's rule. wrench: (4,) thrust (N), moments about x, y, z (N m). m.thrust is the thrust at the end.
    """
    p, m = f.p, f.m
    row = (m.command_count - 1 - p.command_delay) % m.commands.shape[0]
    decay, half_decay = 0.0, 0.0
    if p.rotor_time_constant > 0.0:
        half_decay = math.exp(-0.5 * elapsed / p.rotor_time_constant)
        decay = half_decay * half_decay
    for i in range(4):
        wrench[i] = 0.0
    m.thrust = 0.0
    for i in range(p.rotor_count):
        command = m.commands[row, i] if m.command_count > p.command_delay else 0.0
        start = m.rotor_speed[i]
        if p.rotor_time_constant > 0.0:
            middle = command + (start - command) * half_decay
            end = command + (start - command) * decay
            squared = (start * start + 4.0 * middle * middle + end * end) / 6.0
        else:
            end = command
            squared = command * command
        m.rotor_speed[i] = end
        lift = p.thrust_coefficient[i] * squared
        wrench[0] += lift
        wrench[1] += p.rotor_y[i] * lift
        wrench[2] -= p.rotor_x[i] * lift
        wrench[3] += p.reaction_coefficient[i] * squared
        m.thrust += p.thrust_coefficient[i] * end * end
