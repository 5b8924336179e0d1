"""How late ticks were: a histogram of fixed size, however long the flight."""

from __future__ import annotations

import math

SHORTEST, LONGEST = 1e-7, 1e3
"""s: what is less late, or later, is counted in the first or the last bin."""
BINS_PER_E = 200
"""Bins for each factor e: each is 0.5 % wide."""
BINS = math.ceil(math.log(LONGEST / SHORTEST) * BINS_PER_E) + 1


class Lateness:
    """A histogram with bins of equal width on a logarithmic scale."""

    def __init__(self) -> None:
        self.ticks = 0
        self.largest = 0.0
        """s"""
        self._counts = [0] * BINS

    def add(self, lateness: float) -> None:
        """Count one tick, so many seconds late."""
        place = int(math.log(lateness / SHORTEST) * BINS_PER_E) if lateness > SHORTEST else 0
        self._counts[min(place, BINS - 1)] += 1
        self.ticks += 1
        if lateness > self.largest:
            self.largest = lateness

    def percentile(self, percent: float) -> float | None:
        """What so many percent of the ticks did not exceed, s, to 0.25 %; None before the first tick."""
        below, wanted = 0, self.ticks * percent / 100.0
        for place, count in enumerate(self._counts):
            below += count
            if count and below >= wanted:
                return min(SHORTEST * math.exp((place + 0.5) / BINS_PER_E), self.largest)
        return None
