"""The clock of the telemetry's time stamps, read between two ticks."""

from __future__ import annotations

import math


class PlantClock:
    """The plant's time, which goes on between its ticks as ours does, and never past the next one."""

    def __init__(self) -> None:
        self._time = math.nan
        self._seen = 0.0
        self._tick = 0.0

    def note(self, time: float, now: float) -> None:
        """A tick of the plant: its time (s) at ours."""
        if time != self._time:
            self._tick = max(0.0, time - self._time) if time - self._time < 1.0 else 0.0
            self._time, self._seen = time, now

    def read(self, now: float) -> float:
        """s of the plant's time; ours before its first tick."""
        if math.isnan(self._time):
            return now
        return self._time + min(max(0.0, now - self._seen), self._tick)
