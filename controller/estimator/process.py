"""How vehicle and load move between two ticks, and what that does to the covariance.

The thrust and the moments are known from the rotor commands, the cable's force from its elongation, drag in
still air from the velocity; what is left on the vehicle is one coloured specific force, the state `force`
(Ornstein-Uhlenbeck), and white gusts. The inertial
sensors are measurements of this motion and drive nothing, so their noise enters the filter once and is
correlated with nothing.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from controller.estimator.layout import (
    ACCEL_BIAS,
    ATTITUDE,
    BARO_OFFSET,
    ERROR_SIZE,
    FLYING,
    FORCE,
    GYRO_BIAS,
    LOAD,
    LOAD_MASS,
    LOAD_ON_CABLE,
    LOAD_RELEASED,
    LOAD_VELOCITY,
    LOAD_WIND,
    POSITION,
    RATES,
    STANDING,
    VELOCITY,
    X_FORCE,
    X_LOAD,
    X_LOAD_MASS,
    X_LOAD_VELOCITY,
    X_LOAD_WIND,
    X_POSITION,
    X_RATES,
    X_VELOCITY,
    Array,
    Filter,
)
from controller.estimator.rotation import matrix, turn
from sitl_bridge.compiled import kernel


def _pattern() -> tuple[Any, Any]:
    """Rows of the transition matrix that are not those of the identity: (row starts, column indices).

    A row without entries is the identity's; start and end of row i are starts[i] and starts[i + 1].
    """
    columns: list[list[int]] = [[] for _ in range(ERROR_SIZE)]

    def block(start: int) -> list[int]:
        return [start, start + 1, start + 2]

    for i in range(3):
        around = block(ATTITUDE) + block(RATES) + block(LOAD) + block(LOAD_VELOCITY) + block(FORCE)
        winds = [*block(LOAD_WIND), LOAD_MASS]
        columns[POSITION + i] = [POSITION + i, VELOCITY + i, *around, *winds]
        columns[VELOCITY + i] = [VELOCITY + i, *around, *winds]
        columns[ATTITUDE + i] = block(ATTITUDE) + block(RATES)
        columns[RATES + i] = block(RATES)
        columns[LOAD + i] = [*around, *winds, VELOCITY + i]
        columns[LOAD_VELOCITY + i] = [*around, *winds, VELOCITY + i]
        columns[FORCE + i] = [FORCE + i]
    starts = np.cumsum([0, *(len(row) for row in columns)])
    return starts.astype(np.int64), np.array([c for row in columns for c in row], dtype=np.int64)


ROW_STARTS, COLUMNS = _pattern()


@kernel
def cable(f: Filter, jacobian: Array) -> tuple[float, float, float]:
    """The cable's force on the vehicle, N, world; writes its derivatives.

    F = T e with T = k_a (l - l_0) + c_a dl/dt (eq. 9, corrected), e from vehicle to load.
    jacobian: (18,) written: dF/d(load position) and dF/d(load velocity), 3x3 by rows; zero when slack.
    """
    p, x = f.p, f.x
    for i in range(18):
        jacobian[i] = 0.0
    f.m.tension = 0.0
    if f.m.load_mode == LOAD_RELEASED:
        return 0.0, 0.0, 0.0
    rx, ry, rz = x[X_LOAD], x[X_LOAD + 1], x[X_LOAD + 2]
    sx, sy, sz = x[X_LOAD_VELOCITY], x[X_LOAD_VELOCITY + 1], x[X_LOAD_VELOCITY + 2]
    length = math.sqrt(rx * rx + ry * ry + rz * rz) + 1e-9
    ex, ey, ez = rx / length, ry / length, rz / length
    rate = sx * ex + sy * ey + sz * ez
    extension = length - p.rest_length
    tension = p.stiffness * extension + p.damping * rate
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


@kernel
def predict(f: Filter) -> None:
    """Carry state and covariance over one period."""
    p = f.p
    wrench, jacobian = f.vectors[0], f.vectors[1]
    step = p.period / p.substeps
    for _ in range(p.substeps):
        rotors(f, step, wrench)
        if f.m.vehicle_mode == FLYING:
            _fly(f, step, wrench, jacobian)
        else:
            _stand(f, step)
        _propagate(f)
        _add_noise(f, step)
    f.m.time += p.period


@kernel
def _fly(f: Filter, step: float, wrench: Array, jacobian: Array) -> None:
    """Advance the nominal state by the midpoint rule, and write the transition matrix of that step."""
    p, x, phi, m = f.p, f.x, f.transition, f.m
    half = 0.5 * step
    inertia = p.inertia
    # Rotation: the moments are constant over the step, so the rate in its middle turns the vehicle exactly
    # to second order.
    wx, wy, wz = x[X_RATES], x[X_RATES + 1], x[X_RATES + 2]
    ax = (wrench[1] - (inertia[2] - inertia[1]) * wy * wz) / inertia[0]
    ay = (wrench[2] - (inertia[0] - inertia[2]) * wx * wz) / inertia[1]
    az = (wrench[3] - (inertia[1] - inertia[0]) * wx * wy) / inertia[2]
    mx, my, mz = wx + half * ax, wy + half * ay, wz + half * az
    turn(x, half * (wx + 0.5 * half * ax), half * (wy + 0.5 * half * ay), half * (wz + 0.5 * half * az))
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = matrix(x)
    turn(
        x,
        half * (mx + 0.5 * half * ax),
        half * (my + 0.5 * half * ay),
        half * (mz + 0.5 * half * az),
    )
    x[X_RATES] = wx + step * ax
    x[X_RATES + 1] = wy + step * ay
    x[X_RATES + 2] = wz + step * az
    _rotation_transition(phi, inertia, mx, my, mz, step)

    lift = wrench[0] / p.vehicle_mass
    ratio = math.exp(x[X_LOAD_MASS])
    load_mass = p.load_mass * ratio
    hanging = m.load_mode == LOAD_ON_CABLE
    vx, vy, vz = x[X_VELOCITY], x[X_VELOCITY + 1], x[X_VELOCITY + 2]
    sx, sy, sz = x[X_LOAD_VELOCITY], x[X_LOAD_VELOCITY + 1], x[X_LOAD_VELOCITY + 2]
    brake = drag_rate(p.vehicle_drag, p.vehicle_mass, vx, vy, vz)
    load_brake = drag_rate(p.load_drag, load_mass, vx + sx, vy + sy, vz + sz) if hanging else 0.0
    # Translation: forces in the middle of the step.
    fx, fy, fz = cable(f, jacobian)
    mean = _mean_force(p, step)  # of the coloured force over the step, as a fraction of its start
    gx, gy, gz = r02 * lift, r12 * lift, r22 * lift
    ux = x[X_FORCE] * mean - brake * vx
    uy = x[X_FORCE + 1] * mean - brake * vy
    uz = x[X_FORCE + 2] * mean - brake * vz
    dx = x[X_LOAD_WIND] / load_mass - load_brake * (vx + sx)
    dy = x[X_LOAD_WIND + 1] / load_mass - load_brake * (vy + sy)
    dz = x[X_LOAD_WIND + 2] / load_mass - load_brake * (vz + sz)
    own = 1.0 / p.vehicle_mass
    other = 1.0 / load_mass if hanging else 0.0
    both = own + other
    for i in range(3):  # to the middle
        force = fx if i == 0 else (fy if i == 1 else fz)
        thrust = gx if i == 0 else (gy if i == 1 else gz)
        rest = ux if i == 0 else (uy if i == 1 else uz)
        wind = dx if i == 0 else (dy if i == 1 else dz)
        weight = p.gravity if i == 2 else 0.0
        vehicle = thrust + own * force + rest - weight
        load = -other * force + wind - weight if hanging else 0.0
        f.vectors[2, i] = x[X_VELOCITY + i]
        f.vectors[2, 3 + i] = x[X_LOAD + i]
        f.vectors[2, 6 + i] = x[X_LOAD_VELOCITY + i]
        if m.load_mode != LOAD_RELEASED:
            x[X_LOAD + i] += half * x[X_LOAD_VELOCITY + i] + 0.5 * half * half * (load - vehicle)
            x[X_LOAD_VELOCITY + i] += half * (load - vehicle)
    fx, fy, fz = cable(f, jacobian)
    for i in range(3):  # and from the start to the end, with the forces of the middle
        force = fx if i == 0 else (fy if i == 1 else fz)
        thrust = gx if i == 0 else (gy if i == 1 else gz)
        rest = ux if i == 0 else (uy if i == 1 else uz)
        wind = dx if i == 0 else (dy if i == 1 else dz)
        weight = p.gravity if i == 2 else 0.0
        vehicle = thrust + own * force + rest - weight
        load = -other * force + wind - weight if hanging else 0.0
        velocity, offset, relative = f.vectors[2, i], f.vectors[2, 3 + i], f.vectors[2, 6 + i]
        x[X_POSITION + i] += step * velocity + 0.5 * step * step * vehicle
        x[X_VELOCITY + i] = velocity + step * vehicle
        if m.load_mode != LOAD_RELEASED:
            x[X_LOAD + i] = offset + step * relative + 0.5 * step * step * (load - vehicle)
            x[X_LOAD_VELOCITY + i] = relative + step * (load - vehicle)
    fade = math.exp(-step / p.force_time)
    for i in range(3):
        x[X_FORCE + i] *= fade
        phi[FORCE + i, FORCE + i] = fade

    # Transition of the translation, to second order in the step.
    moving = 0.0 if m.load_mode == LOAD_RELEASED else 1.0
    half_square = 0.5 * step * step
    for i in range(3):
        row_v, row_s, row_p, row_r = VELOCITY + i, LOAD_VELOCITY + i, POSITION + i, LOAD + i
        down0 = -lift * (r01 if i == 0 else (r11 if i == 1 else r21))
        down1 = lift * (r00 if i == 0 else (r10 if i == 1 else r20))
        pull = fx if i == 0 else (fy if i == 1 else fz)
        wind = dx if i == 0 else (dy if i == 1 else dz)
        for j in range(3):
            spring, damper = jacobian[3 * i + j], jacobian[9 + 3 * i + j]
            # The damper acts on what the relative velocity gains within the step.
            twice = 0.0
            for k in range(3):
                twice += jacobian[9 + 3 * i + k] * jacobian[3 * k + j]
            twice_damper = 0.0
            for k in range(3):
                twice_damper += jacobian[9 + 3 * i + k] * jacobian[9 + 3 * k + j]
            from_r = step * spring - half_square * both * twice
            from_s = step * damper + half_square * (spring - both * twice_damper)
            diagonal = 1.0 if i == j else 0.0
            phi[row_v, LOAD + j] = own * from_r
            phi[row_v, LOAD_VELOCITY + j] = own * from_s
            phi[row_s, LOAD + j] = -both * from_r * moving
            phi[row_s, LOAD_VELOCITY + j] = diagonal - both * from_s * moving
            phi[row_p, LOAD + j] = own * half_square * spring
            phi[row_p, LOAD_VELOCITY + j] = own * half_square * damper
            phi[row_r, LOAD + j] = diagonal - both * half_square * spring * moving
            phi[row_r, LOAD_VELOCITY + j] = (diagonal * step - both * half_square * damper) * moving
            phi[row_v, FORCE + j] = mean * (diagonal * step - own * half_square * damper)
            phi[row_s, FORCE + j] = -mean * (diagonal * step - both * half_square * damper) * moving
            phi[row_p, FORCE + j] = mean * diagonal * half_square
            phi[row_r, FORCE + j] = -mean * diagonal * half_square * moving
            gust = other * (diagonal * step - both * half_square * damper)
            phi[row_s, LOAD_WIND + j] = gust * moving
            phi[row_v, LOAD_WIND + j] = own * other * half_square * damper
            phi[row_r, LOAD_WIND + j] = other * diagonal * half_square * moving
        phi[row_v, ATTITUDE] = step * down0
        phi[row_v, ATTITUDE + 1] = step * down1
        phi[row_v, RATES] = half_square * down0
        phi[row_v, RATES + 1] = half_square * down1
        phi[row_s, ATTITUDE] = -step * down0 * moving
        phi[row_s, ATTITUDE + 1] = -step * down1 * moving
        phi[row_s, RATES] = -half_square * down0 * moving
        phi[row_s, RATES + 1] = -half_square * down1 * moving
        phi[row_p, ATTITUDE] = half_square * down0
        phi[row_p, ATTITUDE + 1] = half_square * down1
        phi[row_r, ATTITUDE] = -half_square * down0 * moving
        phi[row_r, ATTITUDE + 1] = -half_square * down1 * moving
        heavier = other * pull - wind if hanging else 0.0
        phi[row_s, LOAD_MASS] = step * heavier
        phi[row_r, LOAD_MASS] = half_square * heavier
        phi[row_v, VELOCITY + i] = 1.0 - step * brake
        phi[row_s, VELOCITY + i] = step * (brake - load_brake) * moving
        phi[row_s, row_s] -= step * load_brake * moving
        phi[row_p, POSITION + i] = 1.0
        phi[row_p, VELOCITY + i] = step


@kernel
def _mean_force(p: Any, step: float) -> float:
    """Mean of exp(-t / force_time) over one step."""
    return float((1.0 - math.exp(-step / p.force_time)) * p.force_time / step)


@kernel
def _rotation_transition(phi: Array, inertia: Any, mx: float, my: float, mz: float, step: float) -> None:
    """Transition of attitude error and body rates; (mx, my, mz) is the rate in the middle of the step."""
    ax, ay, az = mx * step, my * step, mz * step
    a, w = ATTITUDE, RATES
    squares = ax * ax + ay * ay + az * az
    for i in range(3):
        vi = ax if i == 0 else (ay if i == 1 else az)
        for j in range(3):
            vj = ax if j == 0 else (ay if j == 1 else az)
            phi[a + i, a + j] = 0.5 * vi * vj + (1.0 - 0.5 * squares if i == j else 0.0)
            phi[a + i, w + j] = step if i == j else 0.0
    # minus the cross product matrix of the turn
    phi[a, a + 1] += az
    phi[a, a + 2] -= ay
    phi[a + 1, a] -= az
    phi[a + 1, a + 2] += ax
    phi[a + 2, a] += ay
    phi[a + 2, a + 1] -= ax
    half = 0.5 * step
    phi[a, w + 1] = half * az
    phi[a, w + 2] = -half * ay
    phi[a + 1, w] = -half * az
    phi[a + 1, w + 2] = half * ax
    phi[a + 2, w] = half * ay
    phi[a + 2, w + 1] = -half * ax
    x, y, z = inertia[0], inertia[1], inertia[2]
    phi[w, w] = 1.0
    phi[w + 1, w + 1] = 1.0
    phi[w + 2, w + 2] = 1.0
    phi[w, w + 1] = -(z - y) * az / x
    phi[w, w + 2] = -(z - y) * ay / x
    phi[w + 1, w] = -(x - z) * az / y
    phi[w + 1, w + 2] = -(x - z) * ax / y
    phi[w + 2, w] = -(y - x) * ay / z
    phi[w + 2, w + 1] = -(y - x) * ax / z


@kernel
def _stand(f: Filter, step: float) -> None:
    """The vehicle stands, or is held: nothing moves, up to what the pseudo-measurements of rest leave."""
    p, x, phi = f.p, f.x, f.transition
    for i in range(POSITION, ERROR_SIZE):
        for index in range(ROW_STARTS[i], ROW_STARTS[i + 1]):
            phi[i, COLUMNS[index]] = 1.0 if COLUMNS[index] == i else 0.0
    turn(x, step * x[X_RATES], step * x[X_RATES + 1], step * x[X_RATES + 2])
    fade = math.exp(-step / p.force_time)
    for i in range(3):
        x[X_POSITION + i] += step * x[X_VELOCITY + i]
        x[X_LOAD + i] += step * x[X_LOAD_VELOCITY + i]
        x[X_FORCE + i] *= fade
        phi[POSITION + i, VELOCITY + i] = step
        phi[LOAD + i, LOAD_VELOCITY + i] = step
        phi[ATTITUDE + i, RATES + i] = step
        phi[FORCE + i, FORCE + i] = fade


@kernel
def _propagate(f: Filter) -> None:
    """P = Phi P Phi', exactly symmetric; and the covariance with the remembered instants."""
    phi, cov, first, second = f.transition, f.P, f.scratch[0], f.scratch[1]
    _rows(phi, cov, first, ERROR_SIZE, False)
    for i in range(ERROR_SIZE):
        for j in range(ERROR_SIZE):
            second[i, j] = first[j, i]
    _rows(phi, second, first, ERROR_SIZE, True)
    for i in range(ERROR_SIZE):
        for j in range(i + 1):
            cov[i, j] = first[i, j]
            cov[j, i] = first[i, j]
    width = f.m.clone_width
    if width > 0:
        _rows(phi, f.Pxz, f.wide, width, False)
        for i in range(ERROR_SIZE):
            for j in range(width):
                f.Pxz[i, j] = f.wide[i, j]


@kernel
def _rows(phi: Array, source: Array, out: Array, width: int, lower: bool) -> None:
    """out = Phi source, `width` columns of it or only those up to the diagonal, using where Phi has entries.

    Four of them at a time: that is what keeps the processor's multipliers busy.
    """
    for i in range(ERROR_SIZE):
        index, end = ROW_STARTS[i], ROW_STARTS[i + 1]
        to = out[i]
        count = i + 1 if lower else width
        if index == end:
            one = source[i]
            for j in range(count):
                to[j] = one[j]
            continue
        for j in range(count):
            to[j] = 0.0
        while index + 3 < end:
            a, b, c, d = COLUMNS[index], COLUMNS[index + 1], COLUMNS[index + 2], COLUMNS[index + 3]
            fa, fb, fc, fd = phi[i, a], phi[i, b], phi[i, c], phi[i, d]
            one, two, three, four = source[a], source[b], source[c], source[d]
            for j in range(count):
                to[j] += fa * one[j] + fb * two[j] + fc * three[j] + fd * four[j]
            index += 4
        while index < end:
            a = COLUMNS[index]
            fa, one = phi[i, a], source[a]
            for j in range(count):
                to[j] += fa * one[j]
            index += 1


@kernel
def _pair(cov: Array, i: int, j: int, value: float) -> None:
    cov[i, j] += value
    cov[j, i] += value


@kernel
def _add_noise(f: Filter, step: float) -> None:
    """Add what one step's unknown forces, moments and drifts contribute."""
    p, cov, m = f.p, f.P, f.m
    standing = m.vehicle_mode == STANDING
    tau = p.force_time
    fade = math.exp(-step / tau)
    variance = p.force_std * p.force_std
    # Ornstein-Uhlenbeck force: its value at the end, the velocity it gave, and both together.
    ends = variance * (1.0 - fade * fade)
    gains = variance * tau * tau * (2.0 * step / tau - 3.0 + 4.0 * fade - fade * fade)
    gains += p.gust_density * p.gust_density * step
    joint = variance * tau * (1.0 - fade) * (1.0 - fade)
    load = p.load_force_density * p.load_force_density * step
    torque = p.torque_density * p.torque_density * step
    if m.load_mode != LOAD_ON_CABLE:
        load = 0.0
    if standing:
        gains, joint, load = 1e-4 * step, 0.0, 1e-4 * step
    relative = 0.0 if m.load_mode == LOAD_RELEASED else 1.0
    third = step * step / 3.0
    half = 0.5 * step
    for i in range(3):
        r, s, v, q, w = LOAD + i, LOAD_VELOCITY + i, VELOCITY + i, POSITION + i, FORCE + i
        spin = torque / (p.inertia[i] * p.inertia[i])
        if standing:
            spin = 1e-4 * step
        cov[w, w] += ends
        cov[v, v] += gains
        cov[q, q] += gains * third
        _pair(cov, q, v, gains * half)
        _pair(cov, v, w, joint)
        _pair(cov, q, w, joint * half)
        common = 0.0 if standing else relative
        cov[s, s] += gains * common + load
        cov[r, r] += (gains * common + load) * third
        _pair(cov, r, s, (gains * common + load) * half)
        _pair(cov, s, v, -gains * common)
        _pair(cov, s, q, -gains * half * common)
        _pair(cov, r, v, -gains * half * common)
        _pair(cov, r, q, -gains * third * common)
        _pair(cov, s, w, -joint * common)
        _pair(cov, r, w, -joint * half * common)
        cov[RATES + i, RATES + i] += spin
        cov[ATTITUDE + i, ATTITUDE + i] += spin * third
        _pair(cov, ATTITUDE + i, RATES + i, spin * half)
        cov[GYRO_BIAS + i, GYRO_BIAS + i] += p.gyro_bias_walk * p.gyro_bias_walk * step
        cov[ACCEL_BIAS + i, ACCEL_BIAS + i] += p.accel_bias_walk * p.accel_bias_walk * step
        cov[LOAD_WIND + i, LOAD_WIND + i] += p.load_wind_walk * p.load_wind_walk * step
    cov[BARO_OFFSET, BARO_OFFSET] += p.baro_walk * p.baro_walk * step
    cov[LOAD_MASS, LOAD_MASS] += p.load_mass_walk * p.load_mass_walk * step
