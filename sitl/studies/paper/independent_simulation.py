"""The second, independent simulation: NED and FRD, Euler angles, body velocity, adaptive integrators.

The paper validates its equations against MATLAB's 6-DoF (Euler angles) block; this is that block with load
and cable. It shares with the plant nothing but the vehicle description: not the frames (z is down), not the
attitude (Euler angles, singular at 90° of pitch), not the velocity (body axes, so that Newton's law carries
the transport term), not the integrator, and not the law: the paper's continuous u = u* - K [x - x*; v].
Plain floats rather than small arrays, which are several times slower here. Equation numbers: the paper's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from sitl_bridge.vehicle.description import Vehicle

Array = NDArray[np.float64]
Three = tuple[float, float, float]
Wrench = tuple[float, float, float, float]
"""Total thrust (N) and moments about the body's x, y, z (N m), FLU as the paper's eq. 13."""

STATE_SIZE = 18
STILL: Three = (0.0, 0.0, 0.0)
SINGULAR_PITCH = math.radians(80.0)
FARTHEST = 1e3
"""A run ends when pitch nears its singularity, or anything is so many metres away: it has diverged."""


class Run(NamedTuple):
    """A simulation, in the project's frames: ENU and FLU."""

    time: Array
    """(n,) s"""
    states: Array
    """(n, 18), eq. 31"""
    diverged: bool
    """Whether it ended before its time."""

    @property
    def vehicle(self) -> Array:
        """Vehicle's position (n, 3), m."""
        return self.states[:, 0:3]

    @property
    def load(self) -> Array:
        """Load's position (n, 3), m."""
        return self.states[:, 3:6]


class Law(NamedTuple):
    """The paper's law, eqs. 53 to 56 corrected: u = u* - K [x - x*; v], v the integral of p_p - p_ref."""

    gain: Array
    """(4, 18), or (4, 21) with the integrator"""
    x_star: Array
    """(18,), eq. 31"""
    u_star: Array
    """(4,), N and N m"""
    reference: Callable[[float], Three]
    """p_ref at a time (s), m, ENU"""
    moves_x_star: bool = False
    """Whether x* moves with the reference, instead of the reference entering through the integrator alone."""
    integrates: Callable[[float, Array, Three], Three] | None = None
    """(t, x, p_ref) -> v'; by default p_p - p_ref"""


def derivative(
    vehicle: Vehicle, s: Sequence[float], wrench: Wrench, on_vehicle: Three = STILL, on_load: Three = STILL
) -> list[float]:
    """Time derivative of the state in NED/FRD; forces: N, NED.

    s: position (3), body velocity u v w (3), roll pitch yaw (3), rates p q r (3), load position (3) and
    velocity (3), SI.
    """
    u, v, w, roll, pitch, yaw, p, q, r = s[3:12]
    sr, cr, sp, cp, sy, cy = (
        math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch), math.sin(yaw), math.cos(yaw)
    )  # fmt: skip
    # Eq. 2, corrected: Rz(yaw) Ry(pitch) Rx(roll), from body to world.
    r11, r12, r13 = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    r21, r22, r23 = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    r31, r32, r33 = -sp, cp * sr, cp * cr
    vx, vy, vz = r11 * u + r12 * v + r13 * w, r21 * u + r22 * v + r23 * w, r31 * u + r32 * v + r33 * w

    # Eq. 9: the cable, from the vehicle to the load.
    cable, gravity = vehicle.cable, vehicle.gravity
    mass, load_mass = vehicle.airframe.mass, vehicle.load.mass
    dx, dy, dz = s[12] - s[0], s[13] - s[1], s[14] - s[2]
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    ex, ey, ez = dx / length, dy / length, dz / length
    rate = (s[15] - vx) * ex + (s[16] - vy) * ey + (s[17] - vz) * ez
    pull = cable.stiffness * (length - cable.rest_length) + cable.damping * rate
    if cable.model == "tension-only" and (length <= cable.rest_length or pull < 0.0):
        pull = 0.0

    # Eq. 3 in body axes: gravity, cable and disturbance turned into the body, thrust along -z.
    fx = pull * ex + on_vehicle[0]
    fy = pull * ey + on_vehicle[1]
    fz = pull * ez + on_vehicle[2] + mass * gravity
    thrust, roll_moment, pitch_moment, yaw_moment = wrench
    ix, iy, iz = vehicle.airframe.inertia
    return [
        vx,
        vy,
        vz,
        (r11 * fx + r21 * fy + r31 * fz) / mass - (q * w - r * v),
        (r12 * fx + r22 * fy + r32 * fz) / mass - (r * u - p * w),
        (r13 * fx + r23 * fy + r33 * fz - thrust) / mass - (p * v - q * u),
        p + (q * sr + r * cr) * sp / cp,  # eqs. 49 to 51, corrected
        q * cr - r * sr,
        (q * sr + r * cr) / cp,
        (roll_moment - (iz - iy) * q * r) / ix,  # eq. 10; FLU moments turned by eq. 26
        (-pitch_moment - (ix - iz) * p * r) / iy,
        (-yaw_moment - (iy - ix) * p * q) / iz,
        s[15],
        s[16],
        s[17],
        (on_load[0] - pull * ex) / load_mass,
        (on_load[1] - pull * ey) / load_mass,
        (on_load[2] - pull * ez) / load_mass + gravity,
    ]


def initial_state(vehicle: Vehicle) -> list[float]:
    """The description's initial state in NED/FRD."""
    start = vehicle.initial
    if any(start.vehicle_velocity):
        raise ValueError("the second formulation starts with the vehicle at rest")
    roll, pitch, yaw = start.attitude
    p, q, r = start.body_rates
    x, y, z = vehicle.initial_vehicle_position
    lx, ly, lz = start.load_position
    lvx, lvy, lvz = start.load_velocity
    return [
        y, x, -z, 0.0, 0.0, 0.0, roll, -pitch, math.pi / 2 - yaw, p, -q, -r, ly, lx, -lz, lvy, lvx, -lvz
    ]  # fmt: skip


def eq31(s: Sequence[float]) -> list[float]:
    """State (18,) of eq. 31, ENU and FLU, of a state in NED/FRD."""
    vx, vy, vz = derivative_of_position(s)
    return [
        s[1], s[0], -s[2], s[13], s[12], -s[14], vy, vx, -vz, s[16], s[15], -s[17],
        s[9], -s[10], -s[11], s[6], -s[7], math.pi / 2 - s[8],
    ]  # fmt: skip


def derivative_of_position(s: Sequence[float]) -> Three:
    """Velocity of the vehicle over ground, NED, m/s: its body velocity turned about x, then y, then z."""
    u, v, w, roll, pitch, yaw = s[3:9]
    v, w = v * math.cos(roll) - w * math.sin(roll), v * math.sin(roll) + w * math.cos(roll)
    u, w = u * math.cos(pitch) + w * math.sin(pitch), -u * math.sin(pitch) + w * math.cos(pitch)
    return u * math.cos(yaw) - v * math.sin(yaw), u * math.sin(yaw) + v * math.cos(yaw), w


def simulate(
    vehicle: Vehicle, wrench: Wrench, times: Array, on_vehicle: Three = STILL, on_load: Three = STILL
) -> Run:
    """Open loop: a constant wrench from the description's initial state; DOP853 at 1e-10.

    times: (n,) s, from 0; on_vehicle, on_load: constant external forces on top of gravity, N, ENU.
    """
    forces = _enu_to_ned(on_vehicle), _enu_to_ned(on_load)
    solution = solve_ivp(
        lambda _, s: derivative(vehicle, s.tolist(), wrench, *forces),
        (float(times[0]), float(times[-1])),
        initial_state(vehicle),
        method="DOP853",
        t_eval=times,
        rtol=1e-10,
        atol=1e-10,
    )
    return _run(solution.t, solution.y.T, len(times))


def _enu_to_ned(vector: Three) -> Three:
    # Not `frames.enu_to_ned`: what checks the plant shares nothing with it.
    east, north, up = vector
    return north, east, -up


def fly(vehicle: Vehicle, law: Law, times: Array) -> Run:
    """Closed loop in continuous time, without rotor limits, as the paper's Simulink model; LSODA at 1e-8."""

    def rate(t: float, y: Array) -> list[float]:
        return _closed_loop(vehicle, law, t, y, STILL)

    def lost(_: float, y: Array) -> float:
        return min(SINGULAR_PITCH - abs(float(y[7])), FARTHEST - float(np.max(np.abs(y[:3]))))

    lost.terminal = True  # type: ignore[attr-defined]
    solution = solve_ivp(
        rate,
        (float(times[0]), float(times[-1])),
        [*initial_state(vehicle), 0.0, 0.0, 0.0],
        method="LSODA",
        t_eval=times,
        events=lost,
        rtol=1e-8,
        atol=1e-8,
        max_step=0.1,
    )
    return _run(solution.t, solution.y.T, len(times))


def fly_with_noise(vehicle: Vehicle, law: Law, force_on_load: Array, period: float, steps: int) -> Run:
    """Closed loop under a force on the load that is held for each period: classic Runge-Kutta steps.

    force_on_load: (n, 3) N, ENU; period: s; steps: Runge-Kutta steps in each period.
    """
    y = np.array([*initial_state(vehicle), 0.0, 0.0, 0.0])
    h = period / steps
    rows = [y.copy()]
    for k, (east, north, up) in enumerate(force_on_load.tolist()):
        force = _enu_to_ned((east, north, up))
        for j in range(steps):
            t = k * period + j * h
            k1 = np.array(_closed_loop(vehicle, law, t, y, force))
            k2 = np.array(_closed_loop(vehicle, law, t + h / 2, y + h / 2 * k1, force))
            k3 = np.array(_closed_loop(vehicle, law, t + h / 2, y + h / 2 * k2, force))
            k4 = np.array(_closed_loop(vehicle, law, t + h, y + h * k3, force))
            y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        rows.append(y.copy())
    return _run(np.asarray(np.arange(len(rows)) * period, dtype=float), np.array(rows), len(rows))


def fly_sampled(vehicle: Vehicle, law: Law, period: float, ticks: int, steps: int) -> Run:
    """Closed loop as a computer runs it: u from a sample, held for a period (s); v by the trapezoidal rule.

    law.gain: of the sampled loop, without delay; steps: Runge-Kutta steps in each period. No rotor limits.
    """
    s = initial_state(vehicle)
    h, integral, last = period / steps, np.zeros(3), np.zeros(3)
    rows = [list(s)]
    for k in range(ticks):
        x = np.array(eq31(s))
        error = x[3:6] - law.reference(k * period)
        if k:
            integral += 0.5 * period * (error + last)
        last = error
        thrust, roll, pitch, yaw = (
            law.u_star - law.gain @ np.concatenate([x - law.x_star, integral])
        ).tolist()
        wrench = (thrust, roll, pitch, yaw)
        for _ in range(steps):
            s = _runge_kutta(vehicle, s, wrench, h)
        rows.append(s)
        if not max(map(abs, s[:3])) < FARTHEST or not abs(s[7]) < SINGULAR_PITCH:
            break
    return _run(np.asarray(np.arange(len(rows)) * period, dtype=float), np.array(rows), ticks + 1)


def _runge_kutta(vehicle: Vehicle, s: list[float], wrench: Wrench, h: float) -> list[float]:
    """The state (18,) in NED/FRD, h seconds later, by one classic step."""
    k1 = derivative(vehicle, s, wrench)
    k2 = derivative(vehicle, [a + 0.5 * h * b for a, b in zip(s, k1, strict=True)], wrench)
    k3 = derivative(vehicle, [a + 0.5 * h * b for a, b in zip(s, k2, strict=True)], wrench)
    k4 = derivative(vehicle, [a + h * b for a, b in zip(s, k3, strict=True)], wrench)
    return [
        a + h / 6.0 * (b + 2.0 * c + 2.0 * d + e) for a, b, c, d, e in zip(s, k1, k2, k3, k4, strict=True)
    ]


def _closed_loop(vehicle: Vehicle, law: Law, t: float, y: Array, on_load: Three) -> list[float]:
    """Derivative of the state and the integral, (21,)."""
    s = y.tolist()
    x = np.array(eq31(s))
    reference = law.reference(t)
    error = (x[3] - reference[0], x[4] - reference[1], x[5] - reference[2])
    x_star = law.x_star
    if law.moves_x_star:
        x_star = x_star.copy()
        x_star[0:3] += reference
        x_star[3:6] += reference
    deviation = np.concatenate([x - x_star, y[STATE_SIZE:]])
    u = law.u_star - law.gain @ deviation[: law.gain.shape[1]]
    wrench = (float(u[0]), float(u[1]), float(u[2]), float(u[3]))
    integrated = error if law.integrates is None else law.integrates(t, x, reference)
    return [*derivative(vehicle, s[:STATE_SIZE], wrench, STILL, on_load), *integrated]


def _run(times: Array, states: Array, expected: int) -> Run:
    rows = np.array([eq31(row) for row in states.tolist()])
    return Run(times, rows, len(times) < expected)


def jacobians(vehicle: Vehicle, x: Array, wrench: Wrench, step: float = 1e-4) -> tuple[Array, Array]:
    """A (18, 18) and B (18, 4) in the order of eq. 31, by central differences: the `linmod` of this model.

    x: state of eq. 31 with roll, pitch and yaw at zero; step: of the differences, small beside the cable.
    """

    def rate(x: Array, wrench: Sequence[float]) -> Array:
        thrust, roll, pitch, yaw = wrench
        s = from_eq31(x)
        d = derivative(vehicle, s, (thrust, roll, pitch, yaw))
        ahead, behind = ([a + sign * 1e-5 * b for a, b in zip(s, d, strict=True)] for sign in (1.0, -1.0))
        return np.asarray((np.array(eq31(ahead)) - np.array(eq31(behind))) / 2e-5)

    u = np.array(wrench)
    a = [(rate(x + e, u.tolist()) - rate(x - e, u.tolist())) / (2 * step) for e in step * np.eye(STATE_SIZE)]
    b = [(rate(x, (u + e).tolist()) - rate(x, (u - e).tolist())) / (2 * step) for e in step * np.eye(4)]
    return np.array(a).T, np.array(b).T


def from_eq31(x: Array) -> list[float]:
    """State in NED/FRD of a state (18,) of eq. 31."""
    vx, vy, vz, roll, pitch, yaw = (float(v) for v in (*x[6:9], *x[15:18]))
    # The world velocity north, east, down, turned into the body: about z, then y, then x.
    u, v, w = vy, vx, -vz
    pitch, yaw = -pitch, math.pi / 2 - yaw
    u, v = u * math.cos(yaw) + v * math.sin(yaw), -u * math.sin(yaw) + v * math.cos(yaw)
    u, w = u * math.cos(pitch) - w * math.sin(pitch), u * math.sin(pitch) + w * math.cos(pitch)
    v, w = v * math.cos(roll) + w * math.sin(roll), -v * math.sin(roll) + w * math.cos(roll)
    rest = [x[12], -x[13], -x[14], x[4], x[3], -x[5], x[10], x[9], -x[11]]
    return [float(a) for a in (x[1], x[0], -x[2], u, v, w, roll, pitch, yaw, *rest)]
