"""A sequence of set-points, leg by leg: which one is flown, and when the next begins.

Every leg begins at rest at the point before, and is planned before the first tick. It lasts for its ramp, at
the pace that was found for it, and for the time that the load is to stay; the last one does not end.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from controller.law.reference import Path
from sitl_bridge.frames import MICROSECONDS_PER_SECOND

CABLE_LAGS = 5.0
"""Time constants of the cable for which a leg goes on at least: the next begins with the stretch at rest."""
OnLeg = Callable[[int, int, float], None]
"""Is told which leg begins, from 1, of how many, and when, s since the law took over."""


def no_legs(number: int, count: int, began_s: float) -> None:
    """An `OnLeg` that nobody looks at."""


def planned_legs(path: Path, plan: Callable[[Path], Path]) -> Path:
    """The legs (n,), each as `plan` has it for a path (1,)."""
    out = path.copy()
    for number in range(len(path)):
        out[number] = plan(path[number : number + 1])[0]
    return out


def leg_time(leg: Path, pace: float = 1.0) -> float:
    """How long a leg (1,) lasts, s; pace: at which its ramp is flown, over the plan's."""
    rest = max(float(leg["hold"][0]), CABLE_LAGS * float(leg["cable_lag"][0]) / pace)
    return float(leg["ramp_time"][0]) / pace + rest


class Legs:
    """Hands out the legs after the first. Times are those of the plant, as ticks tell them."""

    def __init__(self, following: Path, rate_hz: float, told: OnLeg = no_legs) -> None:
        """following: the planned legs (n - 1,) after the first; told: at the beginning of each."""
        self.began_s: list[float] = []
        """When each leg began, s since the law took over."""
        self._following = following
        self._rate_hz = rate_hz
        self._told = told
        self._first_usec = 0

    @property
    def count(self) -> int:
        """Of all legs."""
        return len(self._following) + 1

    def begin(self, time_usec: int) -> None:
        """The law takes over at a tick, and with it the first leg begins."""
        self._first_usec = time_usec
        self.began_s = []
        self._note(time_usec)

    def is_over(self, leg: Path, ticks: int, pace: float = 1.0) -> bool:
        """Whether another leg follows this one (1,), of which so many ticks are flown."""
        return len(self.began_s) < self.count and ticks >= self._ticks(leg, pace)

    def next(self, time_usec: int) -> Path:
        """The leg (1,) that begins with a tick."""
        self._note(time_usec)
        number = len(self.began_s) - 2
        return self._following[number : number + 1]

    def due(self, leg: Path, ticks: int, pace: float, time_usec: int) -> float:
        """The plant's time, s, before which this leg is not over; inf: it never is.

        ticks: of the leg, flown with the tick of `time_usec`; pace: known so far, it only falls.
        """
        if len(self.began_s) == self.count:
            return math.inf
        left = self._ticks(leg, pace) - ticks
        return time_usec / MICROSECONDS_PER_SECOND + (left + 0.5) / self._rate_hz

    def _ticks(self, leg: Path, pace: float) -> int:
        return math.ceil(leg_time(leg, pace) * self._rate_hz - 1e-6)

    def _note(self, time_usec: int) -> None:
        self.began_s.append((time_usec - self._first_usec) / MICROSECONDS_PER_SECOND)
        if self.count > 1:
            self._told(len(self.began_s), self.count, self.began_s[-1])
