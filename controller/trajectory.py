"""Targets of ground control -> a motion that the feed-forward can follow, from any state, moving or not.

Two stages, both advanced tick by tick. A *carrot* obeys the limits: it goes to a point, along a velocity or
with a moving set-point, with bounded speed and acceleration. The *motion* follows the carrot through a chain
of five integrators (a reference model with all its poles in one place), so that whatever the carrot does, the
motion has the derivatives that a flat output needs, without a jump.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import linalg

from controller.ground.targets import Follow, Goto, Land
from controller.reference import DERIVATIVES, Path, local_path
from controller.state import Array
from sitl_bridge.frames import Triple

POLE = 6.0
"""1/s, of the reference model; five of them: it settles in some 2 s"""
APPROACH = 1.5
"""1/s, with which the carrot's last bit of way decays"""
BRAKING_SHARE = 0.7
"""Of the acceleration limit, that an approach to a point is planned with"""
YAW_RATE = 0.6
"""rad/s, largest"""
YAW_ACCELERATION = 0.5
"""rad/s²: yaw is what rotors are worst at"""


class Limits(NamedTuple):
    """Of the carrot."""

    acceleration: float
    """m/s²"""
    speed: float
    """m/s, horizontal, where a target has none of its own"""
    up: float
    """m/s"""
    down: float
    """m/s"""


class _Model:
    """The reference model: r(5) = -sum of a_k·r(k) + sum of b_k·c(k), (s + POLE)^5 = s^5 + a_4 s^4 + … + a_0.

    c is the carrot, that moves as a parabola within a period. With b_0 alone the motion is the carrot seen
    through a positive window: it lags 5 / POLE, and keeps every limit that the carrot keeps. With b_k = a_k
    up to the acceleration it follows a moving set-point without a lag.
    """

    def __init__(self, period: float, ahead: bool) -> None:
        order = DERIVATIVES
        self._feedback = np.array([math.comb(order, k) * POLE ** (order - k) for k in range(order)])
        self._forward = self._feedback[:3] * (1.0, ahead, ahead)
        a = np.zeros((order + 3, order + 3))
        a[: order - 1, 1:order] = np.eye(order - 1)
        a[order - 1, :order] = -self._feedback
        a[order - 1, order:] = self._forward
        a[order, order + 1] = a[order + 1, order + 2] = 1.0
        transition = linalg.expm(a * period)
        self._own, self._pull = transition[:order, :order], transition[:order, order:]

    def advance(self, motion: Array, before: Array, after: Array) -> None:
        """Motion (6, 3) a period later, the carrot (3, 3) having gone from one state to another.

        before: with the acceleration of the period.
        """
        motion[:DERIVATIVES] = self._own @ motion[:DERIVATIVES] + self._pull @ before
        motion[DERIVATIVES] = self._forward @ after - self._feedback @ motion[:DERIVATIVES]


def _approach(away: float, acceleration: float) -> float:
    """Speed at a distance (m) from the point to stop at: braking as planned, then decaying."""
    linear = acceleration / APPROACH**2
    if away < linear:
        return APPROACH * away
    return math.sqrt(2.0 * acceleration * (away - 0.5 * linear))


class Trajectory:
    """The reference of one law; `path` (1,) is what the law follows."""

    def __init__(self, period: float) -> None:
        self.path: Path = local_path()
        self._period = period
        self._motion: Array = self.path["motion"][0]
        self._smooth, self._ahead = _Model(period, ahead=False), _Model(period, ahead=True)
        self._carrot = np.zeros((3, 3))
        """Position, velocity, acceleration of the carrot"""
        self._age = 0.0
        """s since the target was given"""
        self._target: Goto | Land | Follow | None = None

    def start(self, position: Array, velocity: Array, yaw: float) -> None:
        """Begin where a body is, with the velocity it has (m, m/s, rad)."""
        self._motion[:] = 0.0
        self._motion[0], self._motion[1] = position, velocity
        self._carrot[:] = self._motion[:3]
        self.path["yaw"], self.path["yaw_rate"] = yaw, 0.0
        self._target = None

    def advance(self, target: Goto | Land | Follow, limits: Limits, time: float) -> None:
        """Go on by one period towards a target; `time` (s) is that of the law's step to come."""
        if target is not self._target:
            self._target, self._age = target, 0.0
        before = self._carrot.copy()
        self._move_carrot(target, limits)
        before[2] = self._carrot[2]
        model = self._ahead if _moves(target) else self._smooth
        model.advance(self._motion, before, self._carrot)
        self._turn(target)
        self.path["epoch"] = time
        self._age += self._period

    def _move_carrot(self, target: Goto | Land | Follow, limits: Limits) -> None:
        dt = self._period
        position, velocity = self._carrot[0].tolist(), self._carrot[1].tolist()
        wanted, forward = self._wanted(target, limits, position)
        change = [w - v for w, v in zip(wanted, velocity, strict=True)]
        most = (limits.acceleration + math.hypot(*forward)) * dt
        size = math.hypot(*change)
        scale = 1.0 if size <= most else most / size
        for i in range(3):
            step = change[i] * scale
            self._carrot[2, i] = step / dt
            self._carrot[1, i] = velocity[i] + step
            self._carrot[0, i] = position[i] + dt * (velocity[i] + 0.5 * step)

    def _wanted(
        self, target: Goto | Land | Follow, limits: Limits, here: list[float]
    ) -> tuple[Triple, Triple]:
        """Velocity that the carrot is to have now, and the acceleration that is asked for."""
        braking = BRAKING_SHARE * limits.acceleration
        if isinstance(target, Follow):
            return self._followed(target, limits, here)
        way = [p - h for p, h in zip(target.position, here, strict=True)]
        if isinstance(target, Land):
            x, y = _towards((way[0], way[1], 0.0), limits.speed, braking)[:2]
            return (x, y, -target.speed), (0.0, 0.0, 0.0)
        away = math.hypot(*way)
        speed = target.speed
        if away > 0.0:
            vertical = limits.up if way[2] > 0.0 else limits.down
            speed = min(speed, vertical * away / max(abs(way[2]), 1e-9))
        return _towards((way[0], way[1], way[2]), speed, braking), (0.0, 0.0, 0.0)

    def _followed(self, target: Follow, limits: Limits, here: list[float]) -> tuple[Triple, Triple]:
        """A set-point goes on as it says between one message and the next."""
        forward = [0.0 if math.isnan(a) else a for a in target.acceleration]
        velocity = [0.0 if math.isnan(v) else v for v in target.velocity]
        age = self._age
        way = [
            0.0 if math.isnan(p) else p + v * age + 0.5 * a * age * age - h
            for p, v, a, h in zip(target.position, velocity, forward, here, strict=True)
        ]
        pull = _towards((way[0], way[1], way[2]), limits.speed, BRAKING_SHARE * limits.acceleration)
        x, y, z = (v + a * age + p for v, a, p in zip(velocity, forward, pull, strict=True))
        return (x, y, z), (forward[0], forward[1], forward[2])

    def _turn(self, target: Goto | Land | Follow) -> None:
        yaw = float(self.path["yaw"][0])
        rate = 0.0
        if not math.isnan(target.yaw):
            away = math.remainder(target.yaw - yaw, 2.0 * math.pi)
            rate = math.copysign(_approach(abs(away), BRAKING_SHARE * YAW_ACCELERATION), away)
        elif isinstance(target, Follow) and not math.isnan(target.yaw_rate):
            rate = target.yaw_rate
        rate = max(-YAW_RATE, min(YAW_RATE, rate))
        before, step = float(self.path["yaw_rate"][0]), YAW_ACCELERATION * self._period
        rate = max(before - step, min(before + step, rate))
        self.path["yaw"] = math.remainder(yaw + rate * self._period, 2.0 * math.pi)
        self.path["yaw_rate"] = rate


def _moves(target: Goto | Land | Follow) -> bool:
    """Whether a target is a trajectory: a position with its velocity."""
    return isinstance(target, Follow) and any(
        math.isfinite(p) and math.isfinite(v) for p, v in zip(target.position, target.velocity, strict=True)
    )


def _towards(way: Triple, speed: float, braking: float) -> Triple:
    """Velocity along a way (m) that is left, at most `speed`."""
    away = math.hypot(*way)
    if away == 0.0:
        return (0.0, 0.0, 0.0)
    share = min(speed, _approach(away, braking)) / away
    return (way[0] * share, way[1] * share, way[2] * share)
