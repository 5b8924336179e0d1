"""What the law flies on: the plant's truth, or (`estimate_feedback`) the estimate from its sensors."""

from __future__ import annotations

from typing import Protocol

from controller.hil.ticks import Tick, TickReader
from controller.state import Array


class Feedback(Protocol):
    """Makes an estimate (18,) in the order of eq. 31 out of each tick."""

    name: str
    needs_truth: bool
    """Whether the plant is to be asked for ODOMETRY."""
    plain: bool
    """Whether `take` does no more than to hand on the reader's estimate, and `flown` nothing."""

    def take(self, time_usec: int, tick: Tick, reader: TickReader) -> Array | None:
        """The estimate at a new tick; None while there is none to fly on."""

    def flown(self, controls: Array) -> None:
        """The tick was answered, armed, with these controls (16,)."""

    def restart(self) -> None:
        """Another plant, or the same one from its beginning."""


class TruthFeedback:
    """The plant's own truth."""

    name = "truth"
    needs_truth = True
    plain = True

    def take(self, time_usec: int, tick: Tick, reader: TickReader) -> Array | None:
        """The state that the plant says it is in."""
        return reader.estimate if tick.truth else None

    def flown(self, controls: Array) -> None:
        """Truth does not need to know."""

    def restart(self) -> None:
        """Nor does it remember."""
