"""The scenario's faults in time: each acts at its tick."""

from __future__ import annotations

import math

from sitl_bridge.plant.faults.schedule import Action, Faults, Faulty, timeline

_GRAIN = 1e-9  # s; a fault at a tick's time happens at that tick, rounding or not


class DueFaults:
    """Applies what is due, tick by tick of the scenario."""

    def __init__(self, faults: Faults, rate_hz: float) -> None:
        self._timeline = timeline(faults)
        self._rate_hz = rate_hz
        self._done = 0

    def restart(self) -> None:
        """Nothing has happened yet."""
        self._done = 0

    def apply(self, to: Faulty, ticks_flown: int) -> list[Action]:
        """Let happen what is due when so many ticks of the scenario are over; returns what it was."""
        time, begin = ticks_flown / self._rate_hz, self._done
        while self._done < len(self._timeline) and self._timeline[self._done].time <= time + _GRAIN:
            self._timeline[self._done].action.apply(to)
            self._done += 1
        return [due.action for due in self._timeline[begin : self._done]]

    def ticks_left(self, ticks_flown: int) -> int | None:
        """How many ticks, from the one after `ticks_flown` on, end before the next fault; None: there is
        none."""
        if self._done == len(self._timeline):
            return None
        due = math.ceil((self._timeline[self._done].time - _GRAIN) * self._rate_hz)
        return due - 1 - ticks_flown
