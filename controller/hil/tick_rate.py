"""Whether the plant ticks at the rate the law was designed for: at another one its gains may diverge."""

from __future__ import annotations

from collections.abc import Callable

from sitl_bridge.frames import MICROSECONDS_PER_SECOND

TICKS = 4
"""Intervals that are looked at before anything flies."""
TOLERANCE = 0.1
"""Share of the period by which the shortest interval may differ; lost ticks only make intervals longer."""


class TickRate:
    """Watches HIL_SENSOR.time_usec before the law takes over."""

    def __init__(self, rate_hz: float, say: Callable[[str], None]) -> None:
        self._period_us = MICROSECONDS_PER_SECOND / rate_hz
        self._say = say
        self.restart()

    def restart(self) -> None:
        """Another plant, perhaps at another rate."""
        self._times: list[int] = []
        self._fits = False
        self._said = False

    def fits(self, time_usec: int) -> bool:
        """Whether the law may fly, given one more tick; False too while that is not known yet."""
        if self._fits:
            return True
        self._times.append(time_usec)
        if len(self._times) <= TICKS:
            return False
        shortest = min(after - before for before, after in zip(self._times, self._times[1:], strict=False))
        del self._times[0]
        self._fits = abs(shortest - self._period_us) <= TOLERANCE * self._period_us
        if not self._fits and not self._said:
            self._said = True
            self._say(
                f"the plant ticks every {shortest / 1e3:g} ms ({MICROSECONDS_PER_SECOND / shortest:.0f} Hz), "
                f"the law is designed for {MICROSECONDS_PER_SECOND / self._period_us:g} Hz: not armed; "
                f"start both with the same --rate"
            )
        return self._fits
