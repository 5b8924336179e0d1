"""Orbits and figures of eight: a motion of the vehicle around a centre, as set-points of what hangs below it.

The load on its cable swings outwards by itself: on a steady circle it flies a larger one than the vehicle.
Where the vehicle is to be on the pattern exactly, the load's is wider by the factor of a driven pendulum.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

from controller.ground.commands.setpoints import Setpoint
from controller.ground.telemetry.vehicle_state import Profile, VehicleView
from sitl_bridge.frames import Triple, euler_from_quaternion

LARGEST_RADIUS = 1000.0
SMALLEST_RADIUS = 1.0
"""m, PX4's limits of an orbit"""
LARGEST_SPEED = 10.0
"""m/s, likewise"""
LARGEST_ACCELERATION = 2.0
"""m/s², PX4's largest centripetal acceleration of an orbit"""
SPEEDING_UP = 0.5
"""m/s², along the path"""
NEAR = 0.5
"""m, from the pattern's first point, at which the motion along it begins"""
LONGEST_STEP = 0.5
"""s; more between two looks is a break, not a motion"""


class Yaw(IntEnum):
    """ORBIT_YAW_BEHAVIOUR."""

    TO_CENTRE = 0
    AS_AT_START = 1
    FREE = 2
    ALONG = 3
    BY_STICK = 4
    UNCHANGED = 5


class Point(NamedTuple):
    """A moment of a motion, m, m/s, m/s²."""

    position: Triple
    velocity: Triple
    acceleration: Triple


class Orbit:
    """Round a centre (m, of the vehicle), clockwise with a positive radius."""

    def __init__(self, centre: Triple, radius: float, speed: float, yaw: Yaw, turn: float) -> None:
        """turn: rad to go round, 0: for ever."""
        self.centre = centre
        self.radius = min(max(abs(radius), SMALLEST_RADIUS), LARGEST_RADIUS)
        self.sense = -1.0 if (radius > 0.0) == (speed >= 0.0) else 1.0
        """Anticlockwise seen from above: 1"""
        self.speed = min(abs(speed), LARGEST_SPEED, math.sqrt(LARGEST_ACCELERATION * self.radius))
        self.yaw = yaw
        self._turn = turn
        self._phase: float | None = None
        """rad, anticlockwise from east; None: not yet on the circle"""
        self._gone = 0.0
        self._speed = 0.0
        self._time = 0.0
        self._start_yaw = math.nan

    @property
    def over(self) -> bool:
        """Whether it has gone round as far as it was to."""
        return 0.0 < self._turn <= self._gone

    def extent(self) -> tuple[Triple, ...]:
        """The outermost points, m."""
        x, y, z = self.centre
        r = self.radius
        return ((x + r, y, z), (x - r, y, z), (x, y + r, z), (x, y - r, z))

    def setpoint(self, view: VehicleView, profile: Profile) -> Setpoint:
        """What to do now; goes on with the plant's time."""
        if math.isnan(self._start_yaw):
            self._start_yaw = euler_from_quaternion(view.attitude)[2]
        x, y, _ = self.centre
        away = (view.position[0] - x, view.position[1] - y)
        if self._phase is None:
            phase = math.atan2(away[1], away[0]) if math.hypot(*away) > 0.01 else self._start_yaw
            first = self._at(phase)
            if math.dist(view.position, first.position) > NEAR:
                return _setpoint(
                    first._replace(velocity=_NONE, acceleration=_NONE), self._heading(phase), math.nan
                )
            self._phase, self._time = phase, view.time
        step = min(max(view.time - self._time, 0.0), LONGEST_STEP)
        self._time = view.time
        self._speed = min(self.speed, self._speed + SPEEDING_UP * step)
        rate = self._speed / self.radius
        self._phase += self.sense * rate * step
        self._gone += rate * step
        point = self._at(self._phase)
        load = _wider(point, self.centre, _swing(rate, profile) if view.load_attached else 1.0)
        turns = self.yaw in (Yaw.TO_CENTRE, Yaw.ALONG)
        yaw_rate = self.sense * rate if turns else math.nan
        return _setpoint(load, self._heading(self._phase), yaw_rate, view.load_attached, profile.hover_length)

    def _at(self, phase: float) -> Point:
        c, s, r, v = math.cos(phase), math.sin(phase), self.radius, self._speed
        x, y, z = self.centre
        speeding = SPEEDING_UP if self._speed < self.speed else 0.0
        radial = -v * v / r
        tangent = (-self.sense * s, self.sense * c)
        return Point(
            (x + r * c, y + r * s, z),
            (v * tangent[0], v * tangent[1], 0.0),
            (radial * c + speeding * tangent[0], radial * s + speeding * tangent[1], 0.0),
        )

    def _heading(self, phase: float) -> float:
        if self.yaw is Yaw.TO_CENTRE:
            return math.remainder(phase + math.pi, 2.0 * math.pi)
        if self.yaw is Yaw.ALONG:
            return math.remainder(phase + self.sense * 0.5 * math.pi, 2.0 * math.pi)
        return self._start_yaw if self.yaw is Yaw.AS_AT_START else math.nan


class FigureEight:
    """A lemniscate around a centre (m, of the vehicle): x = A sin wt, y = B sin 2wt along its axes."""

    def __init__(self, centre: Triple, major: float, minor: float, axis: float, speed: float) -> None:
        """major, minor: m, half of its length and width; axis: rad ENU, of its length; speed: m/s."""
        self.centre = centre
        self.major, self.minor, self.axis = abs(major), abs(minor), axis
        self.sense = 1.0 if major >= 0.0 else -1.0
        fastest = math.hypot(self.major, 2.0 * self.minor)
        hardest = math.hypot(self.major, 4.0 * self.minor)
        self.rate = min(speed / fastest, math.sqrt(LARGEST_ACCELERATION / hardest))
        """rad/s, so that neither speed nor acceleration is too large anywhere"""
        self._rate = 0.0
        self._phase: float | None = None
        self._time = 0.0

    def extent(self) -> tuple[Triple, ...]:
        """The outermost points, m."""
        corners = ((self.major, self.minor), (-self.major, self.minor))
        points = [self._in_world(a, b) for a, b in (*corners, *((-a, -b) for a, b in corners))]
        return tuple((self.centre[0] + x, self.centre[1] + y, self.centre[2]) for x, y, _ in points)

    def setpoint(self, view: VehicleView, profile: Profile) -> Setpoint:
        """What to do now; goes on with the plant's time."""
        if self._phase is None:
            if math.dist(view.position, self.centre) > NEAR:
                return _setpoint(Point(self.centre, _NONE, _NONE), math.nan, math.nan)
            self._phase, self._time = 0.0, view.time
        step = min(max(view.time - self._time, 0.0), LONGEST_STEP)
        self._time = view.time
        gain = SPEEDING_UP / math.hypot(self.major, 2.0 * self.minor)
        speeding = gain if self._rate < self.rate else 0.0
        self._rate = min(self.rate, self._rate + gain * step)
        self._phase += self._rate * step
        wide = [_swing(k * self._rate, profile) if view.load_attached else 1.0 for k in (1, 2)]
        along = _harmonic(self.major * wide[0], 1, self._phase, self._rate, speeding)
        across = _harmonic(self.sense * self.minor * wide[1], 2, self._phase, self._rate, speeding)
        place, velocity, acceleration = (self._in_world(a, b) for a, b in zip(along, across, strict=True))
        x, y, z = (c + p for c, p in zip(self.centre, place, strict=True))
        point = Point((x, y, z), velocity, acceleration)
        yaw = math.atan2(velocity[1], velocity[0]) if math.hypot(*velocity) > 0.3 else math.nan
        return _setpoint(point, yaw, math.nan, view.load_attached, profile.hover_length)

    def _in_world(self, along: float, across: float) -> Triple:
        c, s = math.cos(self.axis), math.sin(self.axis)
        return (along * c - across * s, along * s + across * c, 0.0)


Pattern = Orbit | FigureEight
_NONE: Triple = (math.nan, math.nan, math.nan)


def _harmonic(size: float, times: int, phase: float, rate: float, speeding: float) -> tuple[float, ...]:
    """size·sin(times·phase) and its first two derivatives in time."""
    s, c = math.sin(times * phase), math.cos(times * phase)
    w = times * rate
    return (size * s, size * w * c, size * (times * speeding * c - w * w * s))


def _swing(rate: float, profile: Profile) -> float:
    """The load's radius over the vehicle's, on a circle of `rate` (rad/s): a pendulum that is driven."""
    return 1.0 / max(0.5, 1.0 - rate * rate * profile.hover_length / profile.gravity)


def _wider(point: Point, centre: Triple, factor: float) -> Point:
    x, y = (c + factor * (p - c) for p, c in zip(point.position[:2], centre[:2], strict=True))
    velocity = (factor * point.velocity[0], factor * point.velocity[1], 0.0)
    acceleration = (factor * point.acceleration[0], factor * point.acceleration[1], 0.0)
    return Point((x, y, point.position[2]), velocity, acceleration)


def _setpoint(
    point: Point, yaw: float, yaw_rate: float, of_load: bool = False, hanging: float = 0.0
) -> Setpoint:
    x, y, z = point.position
    below = (x, y, z - hanging) if of_load else point.position
    return Setpoint(of_load, below, point.velocity, point.acceleration, yaw, yaw_rate)
