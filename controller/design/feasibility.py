"""What a vehicle cannot fly, said before it is tried. Pure functions.

A reason is one line: which number is the trouble, how large it is, and what would do.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from controller.design.motion.ramp import LARGEST_THRUST, STEEPEST, Demand, demand_of_circle, planned
from controller.law.reference import Path
from sitl_bridge.vehicle.description import Vehicle, hover_rotor_speeds
from sitl_bridge.vehicle.rotors import Rotor, full_thrust, rotor_effect

LEAST_THRUST = 1.05
"""Of what hovering takes, of each rotor: with less, `heavy` could not be steered on noisy sensors."""
RIGHTED_ANGLE = math.radians(30.0)
LONGEST_RIGHTING = 0.6
"""s, in which rotors have to turn the vehicle by that angle: in that time it falls by 1.8 m."""
FASTEST_CIRCLE = 1.5
"""Times the frequency at which the load swings; on faster circles the gains for hover do not hold."""
LONGEST_ENTRY = 60.0
"""s, in which a load has to get on its circle."""


def vehicle_faults(vehicle: Vehicle) -> list[str]:
    """Why no law flies this vehicle; empty: there is no reason."""
    return [*_thrust(vehicle), *_rotors_too_slow(vehicle)]


def path_faults(path: Path, vehicle: Vehicle, feasible: bool = True, key: str = "position") -> list[str]:
    """Why the vehicle cannot fly this path (1,); empty: there is no reason.

    feasible: the design follows a feasible motion. Otherwise the path is only held against the ground.
    key: of a set-point in its reference.
    """
    faults = _below_ground(path, vehicle, key)
    if feasible and float(path["radius"][0]) > 0.0:
        faults += _circle(path, vehicle)
    return faults


def _thrust(vehicle: Vehicle) -> list[str]:
    shares = [speed / rotor.max_speed for speed, rotor in _hovering(vehicle)]
    busiest = int(np.argmax(shares))
    ratio = shares[busiest] ** -2
    if ratio >= LEAST_THRUST:
        return []
    full = full_thrust(vehicle.rotors)
    too_heavy = vehicle.airframe.mass + vehicle.load.mass - full / LEAST_THRUST / vehicle.gravity
    lighter = f" or {_short(too_heavy)} kg less" if too_heavy > 0.0 else ""
    fastest = vehicle.rotors[busiest].max_speed * math.sqrt(LEAST_THRUST / ratio)
    return [
        f"rotors.{busiest}.max_speed = {vehicle.rotors[busiest].max_speed:g} rad/s: hovering takes "
        f"{100.0 / ratio:.0f} % of its thrust, which leaves none to steer with; expected {fastest:.4g} rad/s"
        f"{lighter}"
    ]


def _rotors_too_slow(vehicle: Vehicle) -> list[str]:
    """Moments come too late, or are too small, to keep the vehicle upright."""
    lag = max(rotor.time_constant for rotor in vehicle.rotors)
    time, axis = max((_righting_time(vehicle, axis, lag), axis) for axis in (0, 1))
    if time <= LONGEST_RIGHTING:
        return []
    name = ("roll", "pitch")[axis]
    said = f"it takes {_short(time)} s to {name} the vehicle by 30 degrees, {LONGEST_RIGHTING:g} s at most"
    if _righting_time(vehicle, axis, 0.0) > LONGEST_RIGHTING:
        inertia = vehicle.airframe.inertia[axis]
        would_do = _largest(lambda i: _righting_time(vehicle, axis, lag, i) <= LONGEST_RIGHTING, inertia)
        return [
            f"airframe.inertia.{axis} = {inertia:g} kg m²: {said}; expected up to {_short(would_do)} kg m²"
        ]
    would_do = _largest(lambda x: _righting_time(vehicle, axis, x) <= LONGEST_RIGHTING, lag)
    return [f"rotors.*.time_constant = {lag:g} s: {said}; expected up to {_short(would_do)} s"]


def _righting_time(vehicle: Vehicle, axis: int, lag: float, inertia: float | None = None) -> float:
    """s, in which all moment that is left in hover turns the vehicle at rest by `RIGHTED_ANGLE`.

    Without lag it turns with constant acceleration, I w' = M; behind lagging rotors the moment grows with
    M/lag at most, I w'' = M/lag. Both together take about the sum.
    """
    inertia = vehicle.airframe.inertia[axis] if inertia is None else inertia
    angle = RIGHTED_ANGLE * inertia / _spare_moment(vehicle, axis)
    return math.sqrt(2.0 * angle) + math.cbrt(6.0 * angle * lag)


def _spare_moment(vehicle: Vehicle, axis: int) -> float:
    """N m about body x or y that the rotors give in hover, half of it by less thrust, half by more."""
    share = np.maximum(np.abs(np.linalg.pinv(rotor_effect(vehicle.rotors))[:, 1 + axis]), 1e-12)
    hover = np.array([rotor.thrust_coefficient * speed**2 for speed, rotor in _hovering(vehicle)])
    most = np.array([rotor.thrust_coefficient * rotor.max_speed**2 for rotor in vehicle.rotors])
    by_less = float((hover / share).min())
    by_more = min(by_less, float(((most - hover) / share).min()))
    return 0.5 * (by_less + by_more)


def _hovering(vehicle: Vehicle) -> list[tuple[float, Rotor]]:
    return list(zip(hover_rotor_speeds(vehicle), vehicle.rotors, strict=True))


def _below_ground(path: Path, vehicle: Vehicle, key: str) -> list[str]:
    if vehicle.ground is None:
        return []
    lowest, height = vehicle.ground.height + vehicle.load.radius, float(path["centre"][0][2])
    if height >= lowest - vehicle.ground.sink:
        return []
    key = "centre" if float(path["radius"][0]) > 0.0 else key
    return [
        f"reference.{key}.2 = {height:g} m: the load would be in the ground; expected {lowest:g} m or more, "
        f"ground.height with load.radius"
    ]


def fastest_rate(path: Path, vehicle: Vehicle) -> tuple[float, str | None]:
    """The angular rate, rad/s, at which the vehicle can fly this path (1,), and why not at the path's own.

    None: it can at the path's own. The way onto the path is not looked at.
    """
    rate = abs(float(path["angular_rate"][0]))
    excess = _too_fast(path, vehicle)
    if excess is None:
        return rate, None

    def flown(at_rate: float) -> bool:
        other = path.copy()
        other["angular_rate"] = at_rate
        return _too_fast(other, vehicle) is None

    return _largest(flown, rate), excess


def _too_fast(path: Path, vehicle: Vehicle) -> str | None:
    """What a circle asks too much of."""
    fastest = FASTEST_CIRCLE * math.sqrt(vehicle.gravity / vehicle.hover_length)
    excess = _excess(demand_of_circle(path, vehicle))
    if excess is None and abs(float(path["angular_rate"][0])) > fastest:
        return (
            f"the load swings at {_short(fastest / FASTEST_CIRCLE)} rad/s, and follows 1.5 times that at most"
        )
    return excess


def _circle(path: Path, vehicle: Vehicle) -> list[str]:
    radius, rate = float(path["radius"][0]), abs(float(path["angular_rate"][0]))
    excess = _too_fast(path, vehicle)
    if excess is None:
        entry = float(planned(path, vehicle)["ramp_time"][0])
        if entry <= LONGEST_ENTRY:
            return []
        excess = f"the load would be {entry:.0f} s on its way to it, {LONGEST_ENTRY:g} s at most"

    def flown(of_radius: float, at_rate: float) -> bool:
        other = path.copy()
        other["radius"], other["angular_rate"] = of_radius, at_rate
        if _too_fast(other, vehicle) is not None:
            return False
        return float(planned(other, vehicle)["ramp_time"][0]) <= LONGEST_ENTRY

    slower = _largest(lambda x: flown(radius, x), rate)
    smaller = _largest(lambda x: flown(x, rate), radius)
    narrower = f", or radius up to {_short(smaller)} m" if smaller > 0.1 * radius else ""
    return [
        f"reference.angular_rate = {rate:g} rad/s on a radius of {radius:g} m: {excess}; expected "
        f"angular_rate up to {_short(slower)} rad/s{narrower}"
    ]


def _excess(asked: Demand) -> str | None:
    """What is too much of a circle's demand."""
    if asked.thrust > LARGEST_THRUST:
        return f"a rotor would have to give {100.0 * asked.thrust:.0f} % of its thrust, 85 % at most"
    if asked.tilt > STEEPEST:
        return f"the vehicle would have to lean by {math.degrees(asked.tilt):.0f} degrees, 35 at most"
    return None


def _short(value: float) -> str:
    """A value to two digits, without an exponent."""
    return f"{float(f'{value:.2g}'):g}"


def _largest(holds: Callable[[float], bool], below: float) -> float:
    """The largest value below one that does not hold, to two digits, downwards; 0: none holds."""
    low, high = 0.0, below
    for _ in range(12):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    if low == 0.0:
        return 0.0
    digit = 10.0 ** (math.floor(math.log10(low)) - 1)
    return math.floor(low / digit) * digit
