"""How long to wait for an answer before a tick is sent again: RFC 6298's smoothed round trip, times ten.

A sample counts for no more than twice the smoothed round trip: a stall of the machine is no round trip, and
with a time-out of ten each loss behind it would cost ten of them.

The RFC's own time-out, the smoothed round trip and four variations, is always shorter: from its first sample
on, the variation never exceeds twice the smoothed round trip. So it is not kept.

Karn's algorithm: an answer to a repeated tick may belong to any of its sendings, so it is no sample. The
time-out doubles with each repeat of a tick; once there is a sample, not with the first: that one, too, may
have been lost, and ten round trips are long enough for the second to be answered.

A time-out that is too short shows by a second answer to a repeated tick: the first was under way, the repeat
needless. The time-out then doubles and stays doubled until there is a sample. Otherwise a round trip that has
become longer than the time-out would never be measured. A loss shows no second answer, and the next tick has
the plain time-out again: the RFC keeps it doubled against congestion, which one datagram at a time does not
cause.
"""

from __future__ import annotations

FIRST_TIMEOUT = 0.005
"""s, before the first sample."""
LONGEST_TIMEOUT = 0.5
"""s"""
ROUND_TRIPS = 10.0
"""Smoothed round trips in a time-out: the processes share their cores with others."""
LARGEST_SAMPLE = 2.0
"""Of the smoothed round trip, for which a sample counts at most"""
_MOST_DOUBLINGS = 16


class RetransmissionTimer:
    """Smoothed round trip, s, and how often the time-out was doubled: for this tick, and until a sample."""

    def __init__(self) -> None:
        self._smoothed: float | None = None
        self._repeats = 0
        self._needless = 0

    def timeout(self) -> float:
        """s to wait for the answer to what is sent now."""
        if self._smoothed is None:
            base, repeats = FIRST_TIMEOUT, self._repeats
        else:
            base, repeats = ROUND_TRIPS * self._smoothed, max(0, self._repeats - 1)
        doublings = min(_MOST_DOUBLINGS, repeats + self._needless)
        return min(LONGEST_TIMEOUT, base * 2.0**doublings)

    def sample(self, round_trip: float) -> None:
        """The answer to a tick that was sent once came after `round_trip` s."""
        self._needless = 0
        if self._smoothed is None:
            self._smoothed = round_trip
        else:
            most = LARGEST_SAMPLE * self._smoothed
            self._smoothed += 0.125 * (min(round_trip, most) - self._smoothed)

    def expired(self) -> None:
        """No answer came in time."""
        self._repeats += 1

    def over(self) -> None:
        """A tick that was repeated has its answer."""
        self._repeats = 0

    def repeated_needlessly(self) -> None:
        """A second answer to a repeated tick: the first had been under way."""
        self._needless += 1
