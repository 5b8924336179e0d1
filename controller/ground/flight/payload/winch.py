"""The winch as ground control sees it: what it was told, and the rest length that it reports."""

from __future__ import annotations

import math
from enum import IntFlag
from typing import NamedTuple

from sitl_bridge.vehicle.description import Winch as Description

_STIFFNESS = 1.0
"""1/s, with which the last bit of way to a length decays"""
_ACCELERATION = 0.4
"""m/s², with which the rate grows: what the load gains the vehicle loses, until the rotors have followed"""
_THERE = 0.01
"""m, near enough to a length"""


class WinchWork(IntFlag):
    """What the winch is at: those bits of MAV_WINCH_STATUS_FLAG that only whoever commands it knows."""

    NONE = 0
    LOCKED = 16
    DROPPING = 32
    GROUND_SENSE = 128
    RETRACTING = 256
    ABANDON_LINE = 1024
    LOAD_LINE = 4096
    LOAD_PAYLOAD = 8192


class Report(NamedTuple):
    """WINCH_STATUS, as the winch says it."""

    length: float
    """m, of the cable's rest length"""
    speed: float
    """m/s, positive pays out"""
    tension: float
    """kg, as the message has it"""
    status: int
    """MAV_WINCH_STATUS_FLAG"""


class Winch:
    """One winch; a length is held by feedback of what it reports."""

    def __init__(self, description: Description, rest_length: float) -> None:
        """rest_length: m, as described."""
        self.description = description
        self._first = rest_length
        self.restart()

    def restart(self) -> None:
        """As described, and locked."""
        self.report: Report | None = None
        """The last"""
        self.work = WinchWork.NONE
        self.length, self.speed = self._first, 0.0
        """m and m/s, of the rest length: as reported, and as moved on since"""
        self.free = False
        """The clutch is open"""
        self.target: float | None = None
        """m, of a length that was asked for"""
        self._rate = 0.0
        self._most = self.description.rate
        self._commanded = 0.0
        """m/s, now"""

    def heard(self, report: Report) -> None:
        """A report of the winch; one without numbers is none."""
        if math.isfinite(report.length + report.speed):
            self.report, self.length, self.speed = report, report.length, report.speed

    def advance(self, seconds: float) -> None:
        """Time goes by since the last report, and the command follows what is wanted."""
        self.length += self.speed * seconds
        wanted, before = self._wanted_rate(), self._commanded
        step = _ACCELERATION * seconds
        low = before - step if before <= 0.0 else 0.0
        high = before + step if before >= 0.0 else 0.0
        self._commanded = min(max(wanted, low), high)

    @property
    def still(self) -> bool:
        """Whether it stands, and is to go on standing."""
        return self.speed == self._commanded == self._wanted_rate() == 0.0

    def relax(self) -> None:
        """Open the clutch: the cable runs out by its tension."""
        self.target, self._rate, self.free = None, 0.0, True
        self.work = WinchWork.NONE

    def go_by(self, length: float, rate: float) -> None:
        """Pay out (positive) or reel in so much, m, at a rate, m/s (0: the winch's own)."""
        most = self.description.rate
        self.target = min(max(self.length + length, self.shortest), self.longest)
        self._most = min(abs(rate) or most, most)
        self.free = False
        self.work = WinchWork.NONE

    def turn(self, rate: float) -> None:
        """Pay out (positive) or reel in at a rate, m/s; 0: stand."""
        most = self.description.rate
        self.target, self._rate, self.free = None, min(max(rate, -most), most), False
        self.work = WinchWork.NONE

    @property
    def shortest(self) -> float:
        """m, to which the cable can be reeled in."""
        return min(self.description.min_length, self._first)

    @property
    def longest(self) -> float:
        """m, to which the cable can be paid out."""
        return max(self.description.max_length, self._first)

    @property
    def status(self) -> int:
        """MAV_WINCH_STATUS_FLAG: what was reported, and what the winch is at."""
        reported = 0 if self.report is None else self.report.status
        over = self.done and self.work is not WinchWork.LOCKED and self.target is not None
        return reported | (0 if over else self.work)

    @property
    def done(self) -> bool:
        """Whether the length that was asked for is there."""
        return self.target is None or abs(self.target - self.length) < _THERE

    @property
    def output(self) -> float:
        """Actuator control: -1 reel in, 1 pay out, at the winch's rate."""
        return self._commanded / self.description.rate

    def _wanted_rate(self) -> float:
        """m/s"""
        if self.target is None:
            return self._rate
        rate = 0.0 if self.done else _STIFFNESS * (self.target - self.length)
        return min(max(rate, -self._most), self._most)

    @property
    def clutch(self) -> float:
        """Actuator control: -1 open, 1 closed."""
        return -1.0 if self.free else 1.0
