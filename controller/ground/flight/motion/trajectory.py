"""Targets of ground control -> a motion that the feed-forward can follow, from any state, moving or not.

The way of it is `controller.law.approach`; this puts targets and limits into its record.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controller.design.motion.exponential import exponential
from controller.ground.flight.motion.setpoint_types import Follow, Goto, Land
from controller.law.approach import BRAKING_SHARE, advance_path, rebase_path
from controller.law.guide import BASE, DERIVATIVES, LANDING, MOVING, POINT
from controller.law.reference import Path, local_path
from controller.law.state import Array

FASTEST_POLE = 6.0
"""1/s, of the reference model; five of them: it settles in some 2 s"""
POLE_SHARE = 8.0
"""Of g over the cable's length, that the pole's square is at most"""
MOST_JERK = 5.0
"""m/s³, that is believed of a set-point's accelerations"""
SHORTEST_INTERVAL = 0.015
"""s between two set-points from which a jerk is taken"""


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
    floor: float = -math.inf
    """m, below which nothing but a landing sinks"""


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


def _transitions(period: float, feedback: Array) -> tuple[Array, Array]:
    """What a period makes of a motion (5, 3), and what the carrot (3, 3), a parabola in it, adds to that."""
    order = DERIVATIVES
    a = np.zeros((order + 3, order + 3))
    a[: order - 1, 1:order] = np.eye(order - 1)
    a[order - 1, :order] = -feedback
    a[order - 1, order] = feedback[0]
    a[order, order + 1] = a[order + 1, order + 2] = 1.0
    transition = exponential(a * period)
    return transition[:order, :order], transition[:order, order:]


class Trajectory:
    """The reference of one law; `path` (1,) is what the law follows."""

    def __init__(self, period: float, pole: float = FASTEST_POLE, with_the_law: bool = False) -> None:
        """period: s, of the law; pole: 1/s, see `motion_pole`; with_the_law: the control step goes on with
        it, and nobody calls `advance`."""
        self.path: Path = local_path()
        guide = self._guide = self.path[0]["guide"]
        self._pole = pole
        feedback = _feedback(pole)
        guide["active"] = with_the_law
        guide["period"], guide["feedback"], guide["ahead"] = period, feedback, feedback[:BASE] / feedback[0]
        guide["own"], guide["pull"] = _transitions(period, feedback)
        guide["coast"] = exponential(np.eye(BASE, k=1) * period)
        self._base, self._gap, self._carrot = guide["base"], guide["gap"], guide["carrot"]
        self._asked = np.zeros((BASE, 3))
        self._rebase = rebase_path.bind(self.path, self._asked)
        self._advance = advance_path.bind(self.path)
        self._target: Goto | Land | Follow | None = None
        self._limits: Limits | None = None

    def start(self, position: Array, velocity: Array, yaw: float) -> None:
        """Begin where a body is, with the velocity it has (m, m/s, rad)."""
        self._base[:] = 0.0
        self._gap[:] = 0.0
        self._gap[0], self._gap[1] = position, velocity
        self._carrot[0] = position + DERIVATIVES / self._pole * velocity
        self._carrot[1], self._carrot[2] = velocity, 0.0
        self.path["motion"][0] = self._gap
        self.path["yaw"], self.path["yaw_rate"] = yaw, 0.0
        self._target = None

    def lower(self, way: float, speed: float) -> None:
        """All that was said so far is meant so much lower, m; and it sinks at a speed now, m/s."""
        self._gap[0, 2] -= way
        self._carrot[0, 2] -= way
        self._guide["sinking"] = speed

    def aim(self, target: Goto | Land | Follow, limits: Limits) -> None:
        """Go to a target within limits, from the next step on."""
        if limits != self._limits:
            self._limits = limits
            self._guide["limits"] = limits
        if target is not self._target:
            self._take(target, limits)

    def advance(self, target: Goto | Land | Follow, limits: Limits, time: float) -> None:
        """Go on by one period towards a target; `time` (s) is that of the law's step to come."""
        self.aim(target, limits)
        self._advance(time)

    def _take(self, target: Goto | Land | Follow, limits: Limits) -> None:
        """A new target: what it says by itself becomes the base, without a jump of the motion."""
        before, self._target = self._target, target
        if isinstance(target, Follow):
            self._asked[:] = self._base_of(target, before, limits)
            self._rebase()
        elif self._base.any():
            self._asked[:] = 0.0
            self._rebase()
        guide = self._guide
        guide["age"] = 0.0
        guide["target"], guide["yaw"] = target.position, target.yaw
        if isinstance(target, Follow):
            guide["kind"], guide["yaw_rate"] = MOVING, target.yaw_rate
        else:
            guide["kind"] = POINT if isinstance(target, Goto) else LANDING
            guide["speed"] = target.speed

    def _base_of(self, target: Follow, before: Goto | Land | Follow | None, limits: Limits) -> Array:
        position = np.array(target.position)
        base = np.array((position, target.velocity, target.acceleration, (0.0, 0.0, 0.0)))
        # On an axis without a position the base may be anywhere: only its velocity counts.
        base[0] = np.where(np.isnan(position), self._base[0], position)
        if isinstance(before, Follow):
            age = float(self._guide["age"])
            if age < SHORTEST_INTERVAL:
                base[3] = self._base[3]
            else:
                jerk = (base[2] - before.acceleration) / age
                base[3] = np.clip(np.nan_to_num(jerk), -MOST_JERK, MOST_JERK)
        base[np.isnan(base)] = 0.0
        size = math.hypot(*base[2].tolist())
        if size > limits.total:
            base[2] *= limits.total / size
            base[3] = 0.0
        return base
