"""A clock that stands still while this process does: a stall of the machine is nobody else's silence."""

from __future__ import annotations

STALL = 0.1
"""s, by which waking up late counts as a stall"""


class StallFreeClock:
    """Monotonic time less the stalls. No I/O: it is told the time."""

    def __init__(self, monotonic: float) -> None:
        self._last = monotonic
        self.stalled = 0.0
        """s, in all"""

    def monotonic(self, awake: float) -> float:
        """When it will be `awake` on this clock, if nothing stalls."""
        return awake + self.stalled

    def now(self, monotonic: float, meant: float) -> float:
        """The time at `monotonic`, after a sleep that was to end at `meant` or before."""
        late = monotonic - max(self._last, min(meant, monotonic))
        self._last = monotonic
        if late > STALL:
            self.stalled += late
        return monotonic - self.stalled
