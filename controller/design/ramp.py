"""How fast a reference may leave its start: within what the vehicle that follows it can do.

The load's position is a flat output (`law.flatness`): the vehicle's way, tilt and thrust follow from it. On a
long cable the vehicle's acceleration is the load's plus l/g times its snap, so a short step may ask for more
than a long one. The ramp is the shortest one whose motion stays within the limits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controller.law.reference import SMOOTH_STEP, Path
from controller.law.state import Array
from sitl_bridge.vehicle.cable_law import linearised
from sitl_bridge.vehicle.description import Drag, Vehicle
from sitl_bridge.vehicle.rotors import full_thrust, rotor_effect

LARGEST_TILT = math.radians(25.0)
"""Of the vehicle along the ramp, rad."""
OVER_THE_PATH = 1.3
"""So much more tilt than a moving path asks for itself is allowed while the load goes over to it."""
STEEPEST = math.radians(35.0)
"""Likewise, but no more than this, if the path does not ask for more itself."""
LARGEST_THRUST = 0.85
"""Of each rotor's at full speed: the rest is left to the feedback."""
LEAST_TENSION = 0.3
"""Of the load's weight: the cable stays taut."""
SHORTEST_RAMP = 1.0
"""s, beside ten time constants of the rotors."""
RELAXATIONS = 8.0
"""Shortest ramp over the cable's relaxation time, damping over stiffness. The feed-forward has the damper's
share of the stretch to first order in that time: `paper` with 51 N s/m leaned by 73 degrees in one of 4."""
LONGEST_RAMP = 600.0
"""s; nothing that hovers needs more."""
_SAMPLES = 400
_TOLERANCE = 1e-3
"""Of the ramp time that is found."""
_SMOOTH_STEP = [np.polynomial.Polynomial(SMOOTH_STEP).deriv(order) for order in range(3)]


class Demand(NamedTuple):
    """What a motion asks of vehicle and cable at most."""

    tilt: float
    """rad"""
    thrust: float
    """N, of the rotor that gives most, over what it gives at full speed."""
    tension: float
    """N, the least."""


def planned(path: Path, vehicle: Vehicle) -> Path:
    """The path (1,) with its ramp time made long enough for the vehicle; a path given moment by moment stays.

    The motion is feasible if the path itself is.
    """
    out, vehicle = path.copy(), linearised(vehicle)
    if out["local"][0]:
        return out
    lag = max(rotor.time_constant for rotor in vehicle.rotors)
    relaxation = vehicle.cable.damping / vehicle.cable.stiffness
    low, high = max(SHORTEST_RAMP + 10.0 * lag, RELAXATIONS * relaxation), LONGEST_RAMP
    if _within(out, vehicle, low):
        high = low
    while high > low * (1.0 + _TOLERANCE):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if _within(out, vehicle, middle) else (middle, high)
    out["ramp_time"] = high
    return out


def demand(path: Path, vehicle: Vehicle, ramp_time: float, times: Array) -> Demand:
    """What the path asks for over the times (n,), s, evenly spaced, if its ramp takes `ramp_time` s."""
    load, velocity, acceleration = _motion(path, ramp_time, times)
    gravity = np.array([0.0, 0.0, vehicle.gravity])
    pull = vehicle.load.mass * (acceleration + gravity) + _drag(vehicle.load.drag, velocity)
    tension = np.linalg.norm(pull, axis=1)
    length = vehicle.cable.rest_length + tension / vehicle.cable.stiffness
    position = load + (length / np.maximum(tension, 1e-9))[:, None] * pull
    spacing = times[1] - times[0]
    own = (position[2:] - 2.0 * position[1:-1] + position[:-2]) / spacing**2
    drag = _drag(vehicle.airframe.drag, (position[2:] - position[:-2]) / (2.0 * spacing))
    force = vehicle.airframe.mass * (own + gravity) + pull[1:-1] + drag
    tilt = np.arctan2(np.hypot(force[:, 0], force[:, 1]), force[:, 2])
    return Demand(float(tilt.max()), _rotor_share(vehicle, force, float(spacing)), float(pull[:, 2].min()))


def demand_of_circle(path: Path, vehicle: Vehicle) -> Demand:
    """What a circle (1,) asks for once the load is on it."""
    rate = max(abs(float(path["angular_rate"][0])), 1e-3)
    return demand(path, vehicle, 0.0, np.linspace(0.0, 2.0 * math.pi / rate, _SAMPLES))


def _rotor_share(vehicle: Vehicle, force: Array, spacing: float) -> float:
    """Largest thrust of a rotor over its own at full speed, for the forces (n, 3), N, every `spacing` s.

    The moments are those of the attitude's acceleration. Lagging rotors are asked for more, ahead of time.
    """
    pitch = np.arctan2(force[:, 0], force[:, 2])
    roll = -np.arcsin(force[:, 1] / np.linalg.norm(force, axis=1))
    about_x, about_y, _ = vehicle.airframe.inertia
    moments = (about_x * _second(roll, spacing), about_y * _second(pitch, spacing))
    wrench = np.stack([np.linalg.norm(force, axis=1), *moments, np.zeros(len(force))])
    lag = sum(rotor.time_constant for rotor in vehicle.rotors) / len(vehicle.rotors)
    wrench += lag * np.gradient(wrench, spacing, axis=1)
    given = np.linalg.pinv(rotor_effect(vehicle.rotors)) @ wrench
    most = np.array([rotor.thrust_coefficient * rotor.max_speed**2 for rotor in vehicle.rotors])
    return float((given / most[:, None]).max())


def _drag(drag: Drag, velocity: Array) -> Array:
    """Force (n, 3), N, against the drag of a body at velocities (n, 3), m/s, in still air."""
    speed = np.linalg.norm(velocity, axis=1)
    return np.asarray((drag.linear + drag.quadratic * speed)[:, None] * velocity)


def _second(values: Array, spacing: float) -> Array:
    """Second derivative of evenly spaced values (n,)."""
    return np.asarray(np.gradient(np.gradient(values, spacing), spacing))


def _within(path: Path, vehicle: Vehicle, ramp_time: float) -> bool:
    """Whether the ramp asks for no more than the limits, or than the path does itself behind it."""
    ramp = demand(path, vehicle, ramp_time, np.linspace(0.0, ramp_time, _SAMPLES))
    tilt, tension = LARGEST_TILT, LEAST_TENSION * vehicle.load.mass * vehicle.gravity
    hover = vehicle.hover_thrust / full_thrust(vehicle.rotors)
    thrust = max(LARGEST_THRUST, hover + 0.25 * (1.0 - hover))
    if path["radius"][0] > 0.0:
        own = demand_of_circle(path, vehicle)
        steep = max(own.tilt, min(OVER_THE_PATH * own.tilt, STEEPEST))
        tilt, thrust = max(tilt, steep), max(thrust, own.thrust)
        tension = min(tension, own.tension)
    return ramp.tilt <= tilt and ramp.thrust <= thrust and ramp.tension >= tension


def _motion(path: Path, ramp_time: float, times: Array) -> tuple[Array, Array, Array]:
    """Position (n, 3), m, velocity and acceleration of the feasible path at the times (n,)."""
    radius, rate = float(path["radius"][0]), float(path["angular_rate"][0])
    away = []
    for order in range(3):
        phase = rate * times + order * math.pi / 2.0
        columns = (np.sin(phase), np.cos(phase), np.zeros(len(times)))
        away.append(radius * rate**order * np.stack(columns, axis=1))
    start = path["start"][0]
    away[0] = away[0] + path["centre"][0] - start
    if ramp_time <= 0.0:
        return start + away[0], away[1], away[2]
    share = np.clip(times / ramp_time, 0.0, 1.0)
    w = [derivative(share)[:, None] / ramp_time**order for order, derivative in enumerate(_SMOOTH_STEP)]
    return (
        start + w[0] * away[0],
        w[1] * away[0] + w[0] * away[1],
        w[2] * away[0] + 2.0 * w[1] * away[1] + w[0] * away[2],
    )
