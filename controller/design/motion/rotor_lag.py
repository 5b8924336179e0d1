"""What rotors have to give along a motion, and what they miss of it because their speed lags.

The feed-forward leads the rotors' lag by the slope of the whole thrust. A rotor at speed w gives k·w². To
give f it has to be told f + lag·f' + (lag·f')²/4f, with w + lag·w' in place of w. Summed over rotors that
steer against each other, the last term is more than that of the sum: vehicle and load sink. On a step of
centimetres that is much of the way, on one of metres it is nothing.
"""

from __future__ import annotations

import numpy as np

from controller.law.state import Array
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.rotors import rotor_effect

LEAST_THRUST = 0.02
"""Of a rotor's at full speed: one that is asked for less stands, and misses no more than this."""
RECOVERY = 2.0
"""1/s, with which the feedback makes good a height that is lost: both of its poles, about"""


def rotor_shares(vehicle: Vehicle, force: Array, spacing: float, led: bool = True) -> Array:
    """Thrust of each rotor over its own at full speed (rotors, n), for forces (n, 3), N, every `spacing` s.

    The moments are those of the attitude's acceleration. led: what lagging rotors are asked for instead.
    """
    pitch = np.arctan2(force[:, 0], force[:, 2])
    roll = -np.arcsin(force[:, 1] / np.linalg.norm(force, axis=1))
    about_x, about_y, _ = vehicle.airframe.inertia
    moments = (about_x * _second(roll, spacing), about_y * _second(pitch, spacing))
    wrench = np.stack([np.linalg.norm(force, axis=1), *moments, np.zeros(len(force))])
    if led:
        wrench += _lag(vehicle) * np.gradient(wrench, spacing, axis=1)
    given = np.linalg.pinv(rotor_effect(vehicle.rotors)) @ wrench
    return np.asarray(given / _most(vehicle)[:, None])


def sag(vehicle: Vehicle, force: Array, spacing: float) -> float:
    """How far vehicle and load sink, m, for forces (n, 3), N, every `spacing` s, beside their feedback."""
    shares = rotor_shares(vehicle, force, spacing, led=False)
    each = np.maximum(shares, LEAST_THRUST) * _most(vehicle)[:, None]
    total = each.sum(axis=0)
    own = (np.gradient(each, spacing, axis=1) ** 2 / each).sum(axis=0)
    missing = 0.25 * _lag(vehicle) ** 2 * (own - np.gradient(total, spacing) ** 2 / total)
    deepest = speed = depth = 0.0
    for sinking in missing / (vehicle.airframe.mass + vehicle.load.mass):
        speed += spacing * (sinking - 2.0 * RECOVERY * speed - RECOVERY**2 * depth)
        depth += spacing * speed
        deepest = max(deepest, depth)
    return float(deepest)


def _lag(vehicle: Vehicle) -> float:
    """s, of the rotors' speeds, in the mean."""
    return sum(rotor.time_constant for rotor in vehicle.rotors) / len(vehicle.rotors)


def _most(vehicle: Vehicle) -> Array:
    """N, of each rotor at full speed."""
    return np.array([rotor.thrust_coefficient * rotor.max_speed**2 for rotor in vehicle.rotors])


def _second(values: Array, spacing: float) -> Array:
    """Second derivative of evenly spaced values (n,)."""
    return np.asarray(np.gradient(np.gradient(values, spacing), spacing))
