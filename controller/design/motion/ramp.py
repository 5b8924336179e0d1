"""How a reference leaves its start: as fast as the vehicle that follows it can, within limits.

The load's position is a flat output (`law.flatness`): the vehicle's way, tilt and thrust follow from it. On a
long cable the vehicle's acceleration is the load's plus l/g times its snap, so a short step may ask for more
than a long one. To a set-point the load goes on a straight line in the shortest time (`fastest`); onto
a circle it goes with the shortest smooth step whose motion stays within the limits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controller.design.motion.cable_length import SAMPLES, cable_lag, lagging, planned_lengths
from controller.design.motion.fastest import Profile, fastest
from controller.design.motion.limits import Limits, limits_of
from controller.design.motion.rotor_lag import rotor_shares, sag
from controller.design.motion.slower import slower
from controller.design.motion.straight_line import StraightLine, drag_force
from controller.design.remembered import remembered
from controller.law.flatness import LEAST_PULL
from controller.law.reference import PIECE_ORDER, SMOOTH_STEP, Path
from controller.law.state import Array
from sitl_bridge.vehicle.cable_law import linearised
from sitl_bridge.vehicle.description import Vehicle

OVER_THE_PATH = 1.3
"""So much more tilt than a moving path asks for itself is allowed while the load goes over to it."""
STEEPEST = math.radians(35.0)
"""Likewise, but no more than this, if the path does not ask for more itself."""
LARGEST_THRUST = 0.85
"""Of each rotor's at full speed, on a circle: the rest is left to the feedback."""
ENTRY_SHARE = 25.0 / 39.3
"""Of the limit of tilt, that is used on the way onto a circle if the circle itself asks for no more."""
GENTLE = 0.0
"""Agility over a way that is the estimate's own error. With the usual one, half a metre was flown in 1.2 s
at a lean of 25 degrees; a sudden wind made 54 of them."""
SHORTEST_RAMP = 1.0
"""s, of a smooth step, beside ten time constants of the rotors."""
RELAXATIONS = 8.0
"""Shortest smooth step over the cable's relaxation time, damping over stiffness. The feed-forward has the
damper's share of its stretch to first order in that time: with 51 N s/m `paper` leaned by 73 degrees in one
of 4."""
LARGEST_SAG, LONGER = 0.05, 1.25
"""Of the way: so far vehicle and load may sink as their rotors lag. Else the motion is
longer, in steps. One of 11 mm went 43 mm aside."""
SHORTEST_STEP = 1.2
"""s, to a set-point, beside three time constants of the rotors."""
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
    least_thrust: float
    """Of the rotor that gives least, likewise."""


@remembered(64)
def planned(path: Path, vehicle: Vehicle, estimated: bool = False) -> Path:
    """The path (1,) with a ramp that suits the vehicle and its agility; one given moment by moment stays.

    estimated: it is flown on the estimate. The motion is feasible if the path itself is.
    """
    out, vehicle = path.copy(), linearised(vehicle)
    if out["local"][0]:
        return out
    if out["radius"][0] > 0.0 or out["unhurried"][0]:
        return smoothly_planned(path, vehicle)
    _plan_step(out, vehicle, limits_of(vehicle, float(path["agility"][0]), estimated))
    return out


def smoothly_planned(path: Path, vehicle: Vehicle) -> Path:
    """The path (1,) with the shortest smooth step that suits the vehicle and its agility.

    One that is unhurried is gentle: its way is the estimate's own error.
    """
    out, vehicle = path.copy(), linearised(vehicle)
    hurried = not path["unhurried"][0]
    limits = limits_of(vehicle, float(path["agility"][0]) if hurried else GENTLE, estimated=not hurried)
    relaxation = vehicle.cable.damping / vehicle.cable.stiffness
    low = max(SHORTEST_RAMP + 10.0 * slowest_rotor(vehicle), RELAXATIONS * relaxation)
    high = LONGEST_RAMP
    if _within(out, vehicle, low, limits):
        high = low
    while high > low * (1.0 + _TOLERANCE):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if _within(out, vehicle, middle, limits) else (middle, high)
    out["ramp_time"] = high
    return out


def _plan_step(path: Path, vehicle: Vehicle, limits: Limits) -> None:
    """The fastest motion to a set-point."""
    way = path["centre"][0] - path["start"][0]
    if not way.any():
        return
    line, most = StraightLine(vehicle, way, limits), LARGEST_SAG * float(np.linalg.norm(way))
    motion = fastest(line, SHORTEST_STEP + 3.0 * slowest_rotor(vehicle))
    _take(path, motion)
    while _sag(path, vehicle) > most:
        motion = fastest(line, LONGER * motion.duration)
        _take(path, motion)
    path["slower"] = slower(vehicle, way, limits, motion.shares, motion.duration)
    lag = cable_lag(vehicle.cable)
    if lag > 0.0:
        times = np.linspace(0.0, motion.duration, SAMPLES)
        _, velocity, acceleration = motion_of(path, motion.duration, times)
        tension = np.linalg.norm(cable_pull(vehicle, velocity, acceleration), axis=1)
        path["cable_lag"], path["lengths"] = lag, planned_lengths(tension, motion.duration, vehicle.cable)


def _take(path: Path, motion: Profile) -> None:
    """The path is left along a profile."""
    path["ramp_time"], path["pieces"], path["profile"] = motion.duration, len(motion.pieces), motion.pieces


def _sag(path: Path, vehicle: Vehicle) -> float:
    """m, by which vehicle and load sink along the planned path, see `rotor_lag`."""
    duration = float(path["ramp_time"][0])
    times = np.linspace(0.0, duration, _SAMPLES)
    force, _ = _forces(path, vehicle, duration, times)
    return sag(vehicle, force, float(times[1]))


def demand(path: Path, vehicle: Vehicle, ramp_time: float, times: Array) -> Demand:
    """What the path asks for over the times (n,), s, evenly spaced, if its ramp takes `ramp_time` s."""
    force, pull = _forces(path, vehicle, ramp_time, times)
    tilt = np.arctan2(np.hypot(force[:, 0], force[:, 1]), force[:, 2])
    share = rotor_shares(vehicle, force, float(times[1] - times[0]))
    return Demand(float(tilt.max()), float(share.max()), float(pull[:, 2].min()), float(share.min()))


def _forces(path: Path, vehicle: Vehicle, ramp_time: float, times: Array) -> tuple[Array, Array]:
    """N: of the rotors (n - 2, 3), at all times (n,) but the first and the last, and of the cable (n, 3)."""
    load, velocity, acceleration = motion_of(path, ramp_time, times)
    gravity = np.array([0.0, 0.0, vehicle.gravity])
    pull = cable_pull(vehicle, velocity, acceleration)
    tension = np.linalg.norm(pull, axis=1)
    spacing = float(times[1] - times[0])
    steady = vehicle.cable.rest_length + tension / vehicle.cable.stiffness
    first = float(path["lengths"][0, 1, 0, 0]) if path["departs"][0] else None
    length = lagging(steady, spacing, float(path["cable_lag"][0]), first)
    up = np.maximum(pull, [-np.inf, -np.inf, LEAST_PULL * vehicle.load.mass * vehicle.gravity])
    position = load + (length / np.linalg.norm(up, axis=1))[:, None] * up
    own = (position[2:] - 2.0 * position[1:-1] + position[:-2]) / spacing**2
    drag = drag_force(vehicle.airframe.drag, (position[2:] - position[:-2]) / (2.0 * spacing))
    return vehicle.airframe.mass * (own + gravity) + pull[1:-1] + drag, pull


def demand_of_circle(path: Path, vehicle: Vehicle) -> Demand:
    """What a circle (1,) asks for once the load is on it."""
    rate = max(abs(float(path["angular_rate"][0])), 1e-3)
    return demand(path, vehicle, 0.0, np.linspace(0.0, 2.0 * math.pi / rate, _SAMPLES))


def cable_pull(vehicle: Vehicle, velocity: Array, acceleration: Array) -> Array:
    """The cable's pull (n, 3), N, on a load that moves like this (n, 3), m/s and m/s²."""
    weightless = vehicle.load.mass * (acceleration + np.array([0.0, 0.0, vehicle.gravity]))
    return np.asarray(weightless + drag_force(vehicle.load.drag, velocity))


def _within(path: Path, vehicle: Vehicle, ramp_time: float, limits: Limits) -> bool:
    """Whether a smooth step onto the path asks for no more than the limits, or than the path does itself."""
    ramp = demand(path, vehicle, ramp_time, np.linspace(0.0, ramp_time, _SAMPLES))
    own = demand_of_circle(path, vehicle)
    steep = max(own.tilt, min(OVER_THE_PATH * own.tilt, STEEPEST))
    tension = min(limits.tension * vehicle.load.mass * vehicle.gravity, own.tension)
    return (
        ramp.tilt <= max(ENTRY_SHARE * limits.tilt, steep)
        and ramp.thrust <= max(limits.most_thrust, own.thrust)
        and ramp.tension >= tension
    )


def slowest_rotor(vehicle: Vehicle) -> float:
    """s, the longest time constant of a rotor."""
    return max(rotor.time_constant for rotor in vehicle.rotors)


def motion_of(path: Path, ramp_time: float, times: Array) -> tuple[Array, Array, Array]:
    """Position (n, 3), m, velocity and acceleration of the feasible path at the times (n,)."""
    start = path["start"][0]
    away = _of_path(path, times)
    away[0] -= start
    if ramp_time <= 0.0:
        return start + away[0], away[1], away[2]
    w = [share[:, None] / ramp_time**order for order, share in enumerate(_shares(path, times / ramp_time))]
    place, velocity, acceleration = (
        start + w[0] * away[0],
        w[1] * away[0] + w[0] * away[1],
        w[2] * away[0] + 2.0 * w[1] * away[1] + w[0] * away[2],
    )
    if path["departs"][0]:
        shares = np.clip(times / ramp_time, 0.0, 1.0)
        for axis, pieces in enumerate(path["departure"][0]):
            for order, of_it in enumerate((place, velocity, acceleration)):
                of_it[:, axis] += _derivative(pieces, shares, order) / ramp_time**order
    return place, velocity, acceleration


def _of_path(path: Path, times: Array) -> Array:
    """Position of the path itself and its first two derivatives (3, n, 3)."""
    radius, rate, climb = (float(path[name][0]) for name in ("radius", "angular_rate", "climb"))
    rising = (climb * times, np.full(len(times), climb), np.zeros(len(times)))
    out = []
    for order in range(3):
        ahead = order * math.pi / 2.0
        east = radius * rate**order * np.sin(rate * times + ahead)
        north = radius * rate**order * np.cos(rate * times + ahead)
        if path["crossing"][0]:
            north = 0.5 * radius * (2.0 * rate) ** order * np.sin(2.0 * rate * times + ahead)
        out.append(np.stack([east, north, rising[order]], axis=1))
    out[0] = out[0] + path["centre"][0]
    return np.array(out)


def _shares(path: Path, times: Array) -> Array:
    """Share of the way, and its first two derivatives (3, n), at times (n,) over the ramp time."""
    times = np.clip(times, 0.0, 1.0)
    pieces = int(path["pieces"][0])
    if pieces == 0:
        return np.array([derivative(times) for derivative in _SMOOTH_STEP])
    return np.array([_derivative(path["profile"][0, :pieces], times, order) for order in range(3)])


def _derivative(profile: Array, times: Array, order: int) -> Array:
    """A derivative of a piecewise polynomial (pieces, 8), see `reference.Path`, at times (n,) from 0 to 1.

    With the operations of scipy's PPoly in their order: motions stay the same to the last bit.
    """
    joints = np.linspace(0.0, 1.0, len(profile) + 1)
    piece = np.clip(np.searchsorted(joints, times, side="right") - 1, 0, len(profile) - 1)
    within, power = times - joints[piece], np.ones(len(times))
    out = np.zeros(len(times))
    for exponent in range(order, PIECE_ORDER):
        coefficients = profile[:, exponent] * float(len(profile)) ** exponent
        out = out + coefficients[piece] * power * float(math.perm(exponent, order))
        power = power * within
    return out
