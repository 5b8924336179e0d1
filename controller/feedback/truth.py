"""What the law flies on: the plant's truth, or (`feedback.estimate`) the estimate from its sensors."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from controller.hil.answers import AnswerWriter
from controller.hil.ticks import Tick, TickReader
from controller.hil.truth_tick import answer_truth
from controller.law.control_law import Law
from controller.law.reference import Path
from controller.law.state import Array
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.sensors import Sensors

if TYPE_CHECKING:
    from controller.feedback.delay_watch import DelayWatch

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

    def __init__(self, watch: DelayWatch | None = None) -> None:
        """watch: looks for commands that act later than told; None: nobody does."""
        self.loop_delay: int | None = None
        self._watch = watch

    def update(self, time_usec: int, tick: Tick, reader: TickReader) -> Array | None:
        """The state that the plant says it is in."""
        if not tick.truth:
            return None
        if self._watch is not None:
            self._watch.begin(time_usec, reader.estimate)
            if self._watch.found >= 0:
                self.loop_delay = self._watch.take()
        return reader.estimate

    def note_command(self, controls: Array, armed: bool) -> None:
        """Whoever looks for late commands has to know."""
        if self._watch is not None:
            self._watch.answered(controls, armed)

    def note_unheard(self, controls: Array | None) -> None:
        """What the rotors turn the vehicle by in a silence says nothing of a delay."""
        if self._watch is not None:
            self._watch.unheard(controls)

    def plain_tick(self, reader: TickReader, law: Law, writer: AnswerWriter) -> PlainTick | None:
        """Datagram in, control step, answer out."""
        answer: PlainTick = answer_truth.bind(*reader.buffers, *law, *writer.buffers)
        watch = self._watch
        return answer if watch is None else watch.watching(answer, reader, writer.controls)

    def restart(self) -> None:
        """Another flight begins."""
        self.loop_delay = None
        if self._watch is not None:
            self._watch.restart()

    def path_from(self, path_from: PathFrom) -> PathFrom:
        """From where the load is."""
        return path_from
