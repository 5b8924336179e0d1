"""Commands that are the plant's to carry out: passed on over the HIL link, answered with its answer.

The link may lose datagrams: a command is sent again until its acknowledgement is in. That is harmless, for
what fails twice at once has failed once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.commands.result import OK, UNSUPPORTED, Verdict

REPEAT = 0.1
"""s between two sendings"""
PATIENCE = 1.0
"""s for an answer: ground stations ask twice meanwhile"""
LATENESS = 0.5
"""s: so long after the first answer to a command that was sent several times the others may come"""
INJECT_FAILURE: int = mavlink.MAV_CMD_INJECT_FAILURE

Answer = Callable[[Verdict, float], None]


class _Pending(NamedTuple):
    parameters: tuple[float, ...]
    answer: Answer
    until: float


class PlantCommands:
    """One command at a time; the others wait, for acknowledgements do not say which one they mean."""

    def __init__(self) -> None:
        self._waiting: list[_Pending] = []
        self._due = math.inf
        self._sent = 0
        """How often the first of them was sent"""
        self._late = 0
        """Acknowledgements of what is answered that may still come, until..."""
        self._late_until = -math.inf

    def inject_failure(self, parameters: tuple[float, ...], now: float, answer: Answer) -> None:
        """Ask the plant to let something fail; `answer` is called with what comes of it, and when."""
        self._waiting.append(_Pending(parameters, answer, now + PATIENCE * (1 + len(self._waiting))))
        if len(self._waiting) == 1:
            self._due = now

    def heard(self, acknowledgement: Any, now: float) -> None:
        """The plant's COMMAND_ACK."""
        if acknowledgement.command != INJECT_FAILURE:
            return
        if self._late and now < self._late_until:
            self._late -= 1
        elif self._sent:
            self._finish(_verdict(acknowledgement.result), now)

    def to_plant(self, now: float) -> list[Any]:
        """Messages for the plant that are due."""
        if now < self._due:
            return []
        if now >= self._waiting[0].until:
            text = "Failure not injected: the plant does not answer; is it running?"
            self._finish(Verdict(mavlink.MAV_RESULT_FAILED, text), now)
            return self.to_plant(now)
        self._due = now + REPEAT
        self._sent += 1
        parameters = self._waiting[0].parameters
        return [mavlink.MAVLink_command_long_message(0, 0, INJECT_FAILURE, 0, *parameters)]

    def next_deadline(self) -> float:
        """When `to_plant` has something; inf if nothing waits."""
        return self._due

    def _finish(self, verdict: Verdict, now: float) -> None:
        done = self._waiting.pop(0)
        self._late, self._late_until, self._sent = self._sent - 1, now + LATENESS, 0
        self._due = now if self._waiting else math.inf
        done.answer(verdict, now)


def _verdict(result: int) -> Verdict:
    if result == OK.result:
        return OK
    if result == UNSUPPORTED:
        text = "Failure not injected: the plant has no such unit, failure or instance; docs/plant.md, Faults"
        return Verdict(UNSUPPORTED, text)
    return Verdict(result, f"Failure not injected: the plant answers with MAV_RESULT {result}")
