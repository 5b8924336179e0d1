"""What the law flies on: the plant's truth, or (`feedback.estimate`) the estimate from its sensors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from controller.hil.answers import AnswerWriter
from controller.hil.ticks import Tick, TickReader
from controller.hil.truth_tick import answer_truth
from controller.law.control_law import Law
from controller.law.reference import Path
from controller.law.state import Array
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.sensors import Sensors

PlainTick = Callable[[int, int, int, float], int]
"""Answers a datagram that the reader holds: (its length, time_usec of the tick before, the answer's sequence
number, the plant's time in s before which the tick is to be) to the answer's length, which the writer holds;
0: it is no plain tick, and nothing was done."""
PathFrom = Callable[[tuple[float, float, float]], Path]
"""Makes the reference path, given where the load is (m, world) when the law takes over."""


def estimates(feedback: str, vehicle: Vehicle) -> bool:
    """Whether the estimator runs: to fly on it, or beside the truth if the sensors have errors."""
    return feedback == "estimate" or vehicle.sensors != Sensors()


class Feedback(Protocol):
    """Makes an estimate (18,) in the order of eq. 31 out of each tick."""

    name: str
    needs_truth: bool
    """Whether the plant is to be asked for ODOMETRY."""
    loop_delay: int | None
    """Ticks after which commands act, where they were found to act later than told; else None."""

    def update(self, time_usec: int, tick: Tick, reader: TickReader) -> Array | None:
        """The estimate at a new tick; None while there is none to fly on."""

    def note_command(self, controls: Array, armed: bool) -> None:
        """The tick was answered with these controls (16,); disarmed, the rotors stand."""

    def note_unheard(self, controls: Array | None) -> None:
        """The answer comes too late to act; the rotors have these controls (16,) instead, or stand (None)."""

    def plain_tick(self, reader: TickReader, law: Law, writer: AnswerWriter) -> PlainTick | None:
        """The compiled tick of a law in flight; None: there is none, each is to be done in parts."""

    def restart(self) -> None:
        """Another plant, or the same one from its beginning."""

    def path_from(self, path_from: PathFrom) -> PathFrom:
        """How the reference is made, given where this feedback has the load when the law takes over."""


class TruthFeedback:
    """The plant's own truth."""

    name = "truth"
    needs_truth = True
    loop_delay: int | None = None

    def update(self, time_usec: int, tick: Tick, reader: TickReader) -> Array | None:
        """The state that the plant says it is in."""
        return reader.estimate if tick.truth else None

    def note_command(self, controls: Array, armed: bool) -> None:
        """Truth does not need to know."""

    def note_unheard(self, controls: Array | None) -> None:
        """Nor this."""

    def plain_tick(self, reader: TickReader, law: Law, writer: AnswerWriter) -> PlainTick | None:
        """Datagram in, control step, answer out."""
        return answer_truth.bind(*reader.buffers, *law, *writer.buffers)

    def restart(self) -> None:
        """Nor does it remember."""

    def path_from(self, path_from: PathFrom) -> PathFrom:
        """From where the load is."""
        return path_from
