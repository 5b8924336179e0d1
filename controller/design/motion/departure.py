"""A set-point from a state that is not at rest: a swinging load, a cable longer or shorter than in hover.

What the load does of itself in the first moment, the rotors as in hover, has derivatives; a spline takes over
with these and lets them die away, on top of the motion to the set-point. So the reference begins where load,
cable, vehicle and attitude are, and the feedback has nothing to catch.

Among the splines it is the one that asks for the least force of the rotors, squared and summed up, in the
equations that are linear about hover; its duration is the shortest in which the limits are kept.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from controller.design.motion.cable_length import SAMPLES, cable_lag, planned_lengths
from controller.design.motion.limits import Limits, limits_of
from controller.design.motion.ramp import (
    LONGEST_RAMP,
    SHORTEST_STEP,
    cable_pull,
    demand,
    motion_of,
    slowest_rotor,
)
from controller.design.remembered import remembered
from controller.law.reference import MOST_PIECES, PIECE_ORDER, Path
from controller.law.state import Array
from sitl_bridge.frames import quaternion_from_euler, rotate
from sitl_bridge.vehicle.cable_law import linearised
from sitl_bridge.vehicle.description import Vehicle

JOINED = 7
"""Derivatives, with the place, that are given at both ends."""
AT_REST = 1e-4
"""m, m/s, rad: a start nearer to hover is left by a motion from rest."""
AS_DESCRIBED = 0.02
"""m, m/s, rad, rad/s: what the feedback catches without being seen."""
_CHECKED = 400
"""Times at which the limits are kept"""
_TOLERANCE = 5e-3
"""Of the duration that is found"""
_BEYOND = 1.02
"""Over what the start itself asks for, if that is beyond a limit."""


@remembered(64)
def departing(path: Path, vehicle: Vehicle) -> Path:
    """A planned path to a set-point (1,), from the description's initial state if that is not at rest.

    It stays as it is if it begins somewhere else, with a slack cable, or with a vehicle that turns.
    """
    out = path.copy()
    vehicle = linearised(vehicle)
    initial = vehicle.initial
    if (
        path["local"][0]
        or path["unhurried"][0]
        or path["radius"][0] > 0.0
        or initial.start != "hover"
        or any(initial.body_rates)
        or not np.array_equal(path["start"][0], vehicle.initial_load_position)
        or _at_rest(vehicle)
    ):
        return out
    derivatives = first_moment(vehicle)
    if derivatives[2, 2] < -vehicle.gravity - 1e-9:  # the cable does not pull up
        return out
    limits = limits_of(vehicle, float(path["agility"][0]))
    return _shortest(out, vehicle, derivatives, limits)


def begins_as_described(vehicle: Vehicle, estimate: Array) -> bool:
    """Whether an estimate (18,), eq. 31, is the description's initial state, nearly."""
    initial = vehicle.initial
    described = [
        *vehicle.initial_vehicle_position,
        *vehicle.initial_load_position,
        *initial.vehicle_velocity,
        *initial.load_velocity,
        *initial.body_rates,
        *initial.attitude,
    ]
    return bool(np.abs(estimate - np.array(described)).max() < AS_DESCRIBED)


def _at_rest(vehicle: Vehicle) -> bool:
    away = np.subtract(vehicle.initial_vehicle_position, vehicle.initial_load_position)
    away[2] -= vehicle.hover_length
    initial = vehicle.initial
    all_of_it = [*away, *initial.load_velocity, *initial.vehicle_velocity, *initial.attitude[:2]]
    return bool(max(map(abs, all_of_it)) < AT_REST)


def first_moment(vehicle: Vehicle) -> Array:
    """The load's place and derivatives (7, 3) at the start, the rotors giving what they give in hover."""
    attitude = quaternion_from_euler(vehicle.initial.attitude)
    thrust = np.array(rotate(attitude, (0.0, 0.0, vehicle.hover_thrust)))
    places = np.zeros((2, JOINED + 2, 3))  # Taylor coefficients, of vehicle and load
    places[0, :2] = vehicle.initial_vehicle_position, vehicle.initial.vehicle_velocity
    places[1, :2] = vehicle.initial_load_position, vehicle.initial.load_velocity
    cable, masses = vehicle.cable, (vehicle.airframe.mass, vehicle.load.mass)
    drags = (vehicle.airframe.drag.linear, vehicle.load.drag.linear)
    for n in range(JOINED):
        away = places[0] - places[1]
        length = _root(np.sum([_product(away[:, i], away[:, i]) for i in range(3)], axis=0))
        force = cable.stiffness * length + cable.damping * np.append(_slope(length), 0.0)
        force[0] -= cable.stiffness * cable.rest_length
        along = _product(force, _inverse(length))
        for body, sign in ((0, -1.0), (1, 1.0)):
            total = sign * np.array([_product(along, away[:, i])[n] for i in range(3)])
            total -= drags[body] * (n + 1) * places[body, n + 1]
            if n == 0:
                total += thrust * (body == 0) - np.array([0.0, 0.0, masses[body] * vehicle.gravity])
            places[body, n + 2] = total / masses[body] / ((n + 1) * (n + 2))
    return np.asarray(places[1, :JOINED] * np.array([math.factorial(k) for k in range(JOINED)])[:, None])


def _product(a: Array, b: Array) -> Array:
    return np.convolve(a, b)[: len(a)]


def _slope(a: Array) -> Array:
    return np.asarray(a[1:] * np.arange(1.0, len(a)))


def _root(a: Array) -> Array:
    out = np.zeros(len(a))
    out[0] = math.sqrt(a[0])
    for n in range(1, len(a)):
        out[n] = (a[n] - out[1:n] @ out[1:n][::-1]) / (2.0 * out[0])
    return out


def _inverse(a: Array) -> Array:
    out = np.zeros(len(a))
    out[0] = 1.0 / a[0]
    for n in range(1, len(a)):
        out[n] = -(a[1 : n + 1] @ out[:n][::-1]) / a[0]
    return out


def _shortest(path: Path, vehicle: Vehicle, derivatives: Array, limits: Limits) -> Path:
    """The path with the shortest departure that keeps the limits, or as it is if there is none."""
    least = float(path["ramp_time"][0]) if path["pieces"][0] else 0.0
    low = max(least, SHORTEST_STEP + 3.0 * slowest_rotor(vehicle))

    def kept(duration: float) -> bool:
        return _keeps(_with_departure(path, vehicle, derivatives, duration), vehicle, limits, derivatives)

    high = low
    while not kept(high):
        low, high = high, 1.25 * high
        if high > LONGEST_RAMP:
            return path
    while high > low * (1.0 + _TOLERANCE):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if kept(middle) else (middle, high)
    return _with_departure(path, vehicle, derivatives, high, finished=True)


def _keeps(path: Path, vehicle: Vehicle, limits: Limits, derivatives: Array) -> bool:
    duration = float(path["ramp_time"][0])
    asked = demand(path, vehicle, duration, np.linspace(0.0, duration, _CHECKED))
    weight = vehicle.load.mass * vehicle.gravity
    begun = vehicle.load.mass * (derivatives[2, 2] + vehicle.gravity)
    tilt = math.hypot(*vehicle.initial.attitude[:2])
    return (
        asked.tilt <= max(limits.tilt, _BEYOND * tilt)
        and asked.thrust <= limits.most_thrust
        and asked.least_thrust >= limits.least_thrust
        and asked.tension >= min(limits.tension * weight, begun - 0.02 * weight)
    )


def _with_departure(
    path: Path, vehicle: Vehicle, derivatives: Array, duration: float, finished: bool = False
) -> Path:
    out = path.copy()
    if not path["pieces"][0]:
        out["pieces"] = MOST_PIECES  # of a way that is none
    out["ramp_time"], out["departs"], out["slower"] = duration, 1, 0.0
    airframe, load, length = vehicle.airframe.mass, vehicle.load.mass, vehicle.hover_length
    # Rotors' force for the load's acceleration and snap, over the whole mass: about hover.
    swing = airframe / (airframe + load) * length / vehicle.gravity
    bounce = airframe / (airframe + load) * load / vehicle.cable.stiffness
    for axis, factor in enumerate((swing, swing, bounce)):
        given = derivatives[:, axis] * duration ** np.arange(float(JOINED))
        given[0] = 0.0  # the motion to the set-point begins at the load's place
        out["departure"][0, axis] = _least_force(given, factor / duration**2)
    out["cable_lag"] = lag = cable_lag(vehicle.cable)
    out["lengths"][0, 1, 0, 0] = vehicle.initial_length
    if finished and lag > 0.0:
        times = np.linspace(0.0, duration, SAMPLES)
        _, velocity, acceleration = motion_of(out, duration, times)
        tension = np.linalg.norm(cable_pull(vehicle, velocity, acceleration), axis=1)
        out["lengths"] = planned_lengths(tension, duration, vehicle.cable, vehicle.initial_length)
    return out


@lru_cache(maxsize=1)
def _basis() -> tuple[Array, Array, Array, Array]:
    """Pieces (m, pieces, 8) of B-splines; derivatives 2 and 4 (n, m); the first seven (7, 7) at 0."""
    from scipy.interpolate import BSpline, PPoly

    degree = PIECE_ORDER - 1
    knots = np.concatenate([np.zeros(degree), np.linspace(0.0, 1.0, MOST_PIECES + 1), np.ones(degree)])
    count = MOST_PIECES + degree
    spline = BSpline(knots, np.eye(count), degree)
    each = [BSpline(knots, one, degree) for one in np.eye(count)]
    pieces = np.stack([PPoly.from_spline(one).c[::-1, degree:-degree] for one in each], axis=2)
    scale = MOST_PIECES ** -np.arange(float(PIECE_ORDER))
    times = np.linspace(0.0, 1.0, 8 * MOST_PIECES + 1)
    at_start = [spline.derivative(order)(0.0) if order else spline(0.0) for order in range(JOINED)]
    return (
        np.asarray((pieces * scale[:, None, None]).transpose(2, 1, 0)),
        np.asarray(spline.derivative(2)(times)),
        np.asarray(spline.derivative(4)(times)),
        np.array(at_start)[:, :JOINED],
    )


def _least_force(given: Array, factor: float) -> Array:
    """Pieces (pieces, 8) with the given derivatives (7,) at share 0, at rest at 0 at share 1.

    factor: by which the fourth derivative counts beside the second one, over the duration squared.
    """
    pieces, second, fourth, at_start = _basis()
    coefficients = np.zeros(len(pieces))
    coefficients[:JOINED] = np.linalg.solve(at_start, given)
    free = slice(JOINED, len(pieces) - JOINED)
    force = second + factor * fourth
    found, *_ = np.linalg.lstsq(force[:, free], -force @ coefficients, rcond=None)
    coefficients[free] = found
    return np.asarray(np.tensordot(coefficients, pieces, axes=1))
