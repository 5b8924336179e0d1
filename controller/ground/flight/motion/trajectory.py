"""Targets of ground control -> a motion that the feed-forward can follow, from any state, moving or not.

The motion is the sum of two: a *base*, which is what the target says by itself (a moving set-point with its
velocity and acceleration; nothing for a point to go to), and the *gap* to it, which is closed within limits.
A *carrot* with bounded speed and acceleration closes the gap, and the gap follows it through a chain of five
integrators (a reference model with all its poles in one place). When the base jumps, gap and carrot jump the
other way: so whatever a client sends, the motion has the derivatives that a flat output needs, without a
jump, and a set-point that moves smoothly is followed without a lag.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import linalg

from controller.ground.flight.motion.setpoint_types import Follow, Goto, Land
from controller.law.reference import DERIVATIVES, Path, local_path
from controller.law.state import Array
from sitl_bridge.frames import Triple

FASTEST_POLE = 6.0
"""1/s, of the reference model; five of them: it settles in some 2 s"""
POLE_SHARE = 8.0
"""Of g over the cable's length, that the pole's square is at most"""
APPROACH = 1.5
"""1/s, with which the carrot's last bit of way to a point decays"""
CLOSING = 5.0
"""1/s, likewise for the gap to a moving set-point"""
BRAKING_SHARE = 0.7
"""Of the acceleration limit, that an approach to a point is planned with"""
LEAST_CLOSING_SPEED = 0.3
"""Of the speed limit, that is left to close the gap to a set-point that moves fast itself"""
MOST_JERK = 5.0
"""m/s³, that is believed of a set-point's accelerations"""
SHORTEST_INTERVAL = 0.015
"""s between two set-points from which a jerk is taken"""
COASTING = 0.6
"""s after which a set-point that has not been renewed goes on without its acceleration"""
YAW_RATE = 0.6
"""rad/s, largest"""
YAW_ACCELERATION = 0.5
"""rad/s²: yaw is what rotors are worst at"""


class Limits(NamedTuple):
    """Of the motion."""

    acceleration: float
    """m/s², with which a gap is closed"""
    total: float
    """m/s², that and the set-point's own together"""
    speed: float
    """m/s, horizontal, where a target has none of its own"""
    up: float
    """m/s"""
    down: float
    """m/s"""


def motion_pole(length: float, gravity: float) -> float:
    """The reference model's pole, 1/s, for a load on a cable of this length (m).

    The vehicle's acceleration is the load's plus l/g times its snap. Behind a step of the carrot's
    acceleration the snap reaches a tenth of the step times the pole squared. That has to stay a share of the
    step.
    """
    return min(FASTEST_POLE, math.sqrt(POLE_SHARE * gravity / length))


def stopping_distance(speed: float, acceleration: float, pole: float = FASTEST_POLE) -> float:
    """m on which a motion at `speed` (m/s) comes to rest without turning back.

    The motion trails a carrot of steady speed by DERIVATIVES / pole seconds.
    """
    return speed * (DERIVATIVES / pole + 0.5 * speed / (BRAKING_SHARE * acceleration))


def _feedback(pole: float) -> Array:
    """a_k (5,) of the reference model r(5) = a_0·c - sum of a_k·r(k), (s + p)^5 = s^5 + a_4 s^4 + … + a_0.

    c is the carrot: the motion is the carrot seen through a positive window. It lags, and keeps every limit
    that the carrot keeps.
    """
    return np.array([math.comb(DERIVATIVES, k) * pole ** (DERIVATIVES - k) for k in range(DERIVATIVES)])


_BASE = 4
"""Position and derivatives of a base"""


def _transitions(period: float, feedback: Array) -> tuple[Array, Array]:
    """What a period makes of a motion (5, 3), and what the carrot (3, 3), a parabola in it, adds to that."""
    order = DERIVATIVES
    a = np.zeros((order + 3, order + 3))
    a[: order - 1, 1:order] = np.eye(order - 1)
    a[order - 1, :order] = -feedback
    a[order - 1, order] = feedback[0]
    a[order, order + 1] = a[order + 1, order + 2] = 1.0
    transition = linalg.expm(a * period)
    return transition[:order, :order], transition[:order, order:]


class Trajectory:
    """The reference of one law; `path` (1,) is what the law follows."""

    def __init__(self, period: float, pole: float = FASTEST_POLE) -> None:
        """period: s, of the law; pole: 1/s, see `motion_pole`."""
        self.path: Path = local_path()
        self._pole = pole
        self._feedback = _feedback(pole)
        self._ahead = self._feedback[:_BASE] / self._feedback[0]
        """The carrot that belongs to a motion: c = (1 + D/pole)^5 r"""
        self._period = period
        self._motion: Array = self.path["motion"][0]
        self._own, self._pull = _transitions(period, self._feedback)
        self._coast = linalg.expm(np.eye(_BASE, k=1) * period)
        self._base = np.zeros((_BASE, 3))
        """Position, velocity, acceleration, jerk"""
        self._gap = np.zeros((DERIVATIVES + 1, 3))
        self._carrot = np.zeros((3, 3))
        """Position, velocity, acceleration of the gap's carrot"""
        self._age = 0.0
        """s since the target was given"""
        self._target: Goto | Land | Follow | None = None
        self._sinking = 0.0
        """m/s, of `lower`"""

    def start(self, position: Array, velocity: Array, yaw: float) -> None:
        """Begin where a body is, with the velocity it has (m, m/s, rad)."""
        self._base[:] = 0.0
        self._gap[:] = 0.0
        self._gap[0], self._gap[1] = position, velocity
        self._carrot[0] = position + DERIVATIVES / self._pole * velocity
        self._carrot[1], self._carrot[2] = velocity, 0.0
        self._motion[:] = self._gap
        self.path["yaw"], self.path["yaw_rate"] = yaw, 0.0
        self._target = None

    def lower(self, way: float, speed: float) -> None:
        """All that was said so far is meant so much lower, m; and it sinks at a speed now, m/s."""
        self._gap[0, 2] -= way
        self._carrot[0, 2] -= way
        self._sinking = speed

    def advance(self, target: Goto | Land | Follow, limits: Limits, time: float) -> None:
        """Go on by one period towards a target; `time` (s) is that of the law's step to come."""
        if target is not self._target:
            self._take(target, limits)
        elif self._age > COASTING and self._base[2:].any():
            self._rebase(np.vstack((self._base[:2], np.zeros((2, 3)))))
        before = self._carrot.copy()
        self._move_carrot(target, limits)
        before[2] = self._carrot[2]
        gap = self._gap
        gap[:DERIVATIVES] = self._own @ gap[:DERIVATIVES] + self._pull @ before
        gap[DERIVATIVES] = self._feedback[0] * self._carrot[0] - self._feedback @ gap[:DERIVATIVES]
        self._base = self._coast @ self._base
        self._motion[:] = gap
        self._motion[:_BASE] += self._base
        self._motion[1, 2] -= self._sinking
        self._turn(target)
        self.path["epoch"] = time
        self._age += self._period

    def _take(self, target: Goto | Land | Follow, limits: Limits) -> None:
        """A new target: what it says by itself becomes the base, without a jump of the motion."""
        before, self._target = self._target, target
        if isinstance(target, Follow):
            self._rebase(self._base_of(target, before, limits))
        elif self._base.any():
            self._rebase(np.zeros((_BASE, 3)))
        self._age = 0.0

    def _base_of(self, target: Follow, before: Goto | Land | Follow | None, limits: Limits) -> Array:
        position = np.array(target.position)
        base = np.array((position, target.velocity, target.acceleration, (0.0, 0.0, 0.0)))
        # On an axis without a position the base may be anywhere: only its velocity counts.
        base[0] = np.where(np.isnan(position), self._base[0], position)
        if isinstance(before, Follow):
            if self._age < SHORTEST_INTERVAL:
                base[3] = self._base[3]
            else:
                jerk = (base[2] - before.acceleration) / self._age
                base[3] = np.clip(np.nan_to_num(jerk), -MOST_JERK, MOST_JERK)
        base[np.isnan(base)] = 0.0
        size = math.hypot(*base[2].tolist())
        if size > limits.total:
            base[2] *= limits.total / size
            base[3] = 0.0
        return base

    def _rebase(self, base: Array) -> None:
        """Go over to another base; the motion and its derivatives stay as they are."""
        jump = base - self._base
        self._base = base
        self._gap[:_BASE] -= jump
        self._carrot[0] -= self._ahead @ jump
        self._carrot[1] -= self._ahead[:-1] @ jump[1:]

    def _move_carrot(self, target: Goto | Land | Follow, limits: Limits) -> None:
        dt = self._period
        position, velocity = self._carrot[0].tolist(), self._carrot[1].tolist()
        wanted = self._wanted(target, limits, position)
        change = [w - v for w, v in zip(wanted, velocity, strict=True)]
        wish = _shortened([c / dt for c in change], limits.acceleration)
        own = self._base[2].tolist()
        both = _shortened(
            [w + a for w, a in zip(wish, own, strict=True)], max(limits.total, math.hypot(*own))
        )
        for i in range(3):
            step = dt * (both[i] - own[i])
            self._carrot[2, i] = step / dt
            self._carrot[1, i] = velocity[i] + step
            self._carrot[0, i] = position[i] + dt * (velocity[i] + 0.5 * step)

    def _wanted(self, target: Goto | Land | Follow, limits: Limits, here: list[float]) -> Triple:
        """Velocity that the carrot is to have now."""
        braking = BRAKING_SHARE * limits.acceleration
        if isinstance(target, Follow):
            x, y, z = (0.0 if math.isnan(p) else -h for p, h in zip(target.position, here, strict=True))
            own = math.hypot(*self._base[1].tolist())
            speed = max(limits.speed - own, LEAST_CLOSING_SPEED * limits.speed)
            return _towards((x, y, z), speed, limits, braking, CLOSING)
        x, y, z = (p - h for p, h in zip(target.position, here, strict=True))
        if isinstance(target, Land):
            x, y, _ = _towards((x, y, 0.0), limits.speed, limits, braking, APPROACH)
            return (x, y, -target.speed)
        return _towards((x, y, z), target.speed, limits, braking, APPROACH)

    def _turn(self, target: Goto | Land | Follow) -> None:
        yaw = float(self.path["yaw"][0])
        rate = 0.0
        if not math.isnan(target.yaw):
            away = math.remainder(target.yaw - yaw, 2.0 * math.pi)
            rate = math.copysign(_approach(abs(away), BRAKING_SHARE * YAW_ACCELERATION, APPROACH), away)
            if isinstance(target, Follow) and not math.isnan(target.yaw_rate):
                rate += target.yaw_rate
        elif isinstance(target, Follow) and not math.isnan(target.yaw_rate):
            rate = target.yaw_rate
        rate = max(-YAW_RATE, min(YAW_RATE, rate))
        before, step = float(self.path["yaw_rate"][0]), YAW_ACCELERATION * self._period
        rate = max(before - step, min(before + step, rate))
        self.path["yaw"] = math.remainder(yaw + rate * self._period, 2.0 * math.pi)
        self.path["yaw_rate"] = rate


def _shortened(vector: list[float], most: float) -> list[float]:
    """The vector, or the longest of its direction that is allowed."""
    size = math.hypot(*vector)
    return vector if size <= most else [x * (most / size) for x in vector]


def _approach(away: float, braking: float, decay: float) -> float:
    """Speed at a distance (m) from the point to stop at: braking as planned, then decaying."""
    linear = braking / decay**2
    if away < linear:
        return decay * away
    return math.sqrt(2.0 * braking * (away - 0.5 * linear))


def _towards(way: Triple, speed: float, limits: Limits, braking: float, decay: float) -> Triple:
    """Velocity along a way (m) that is left, at most `speed`."""
    away = math.hypot(*way)
    if away == 0.0:
        return (0.0, 0.0, 0.0)
    vertical = limits.up if way[2] > 0.0 else limits.down
    speed = min(speed, vertical * away / max(abs(way[2]), 1e-9))
    share = min(speed, _approach(away, braking, decay)) / away
    return (way[0] * share, way[1] * share, way[2] * share)
