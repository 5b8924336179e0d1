"""How vehicle and load move between two ticks: the nominal state, and the transition matrix of its error.

The thrust and the moments are known from the rotor commands, the cable's force from its elongation, drag in
still air from the velocity (`forces`); what is left on the vehicle is one coloured specific force, the state
`force` (Ornstein-Uhlenbeck), and white gusts. The inertial sensors are measurements of this motion and drive
nothing, so their noise enters the filter once and is correlated with nothing. The covariance: `propagation`.
"""

from __future__ import annotations

import math
from typing import Any

from controller.estimator.predict.forces import cable, drag_rate, rotors
from controller.estimator.predict.propagation import COLUMNS, ROW_STARTS, add_noise, propagate
from controller.estimator.predict.rotation import matrix, turn
from controller.estimator.records import (
    ATTITUDE,
    ERROR_SIZE,
    FLYING,
    FORCE,
    LOAD,
    LOAD_MASS,
    LOAD_ON_CABLE,
    LOAD_RELEASED,
    LOAD_VELOCITY,
    LOAD_WIND,
    POSITION,
    RATES,
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
from sitl_bridge.compiled import kernel


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
        propagate(f)
        add_noise(f, step)
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
