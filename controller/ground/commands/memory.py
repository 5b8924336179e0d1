"""Recent commands and their results: a retransmission has no second effect."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable
from typing import NamedTuple

from controller.ground.commands.result import Verdict

MEMORY = 5.0
"""s, in which the same command with a greater confirmation is taken for a retransmission"""
DOUBLED = 0.2
"""s, in which the same command with the same sequence number is taken for a datagram that came twice"""
_MOST_REMEMBERED = 64


class Key(NamedTuple):
    """What a retransmission has in common with the original: everything but the counters."""

    sender: Hashable
    content: Hashable


class _Remembered(NamedTuple):
    time: float
    """s, when it was carried out"""
    sequence: int
    """Of the frame"""
    confirmation: int
    verdict: Verdict


class Memory:
    """Recent commands of each sender with their results, to know a retransmission by."""

    def __init__(self) -> None:
        self._recent: OrderedDict[Key, _Remembered] = OrderedDict()
        """The oldest first"""

    def recall(self, key: Key, sequence: int, confirmation: int, now: float) -> Verdict | None:
        """The result of the command that this one repeats, None if it is a new one.

        A repetition has a greater confirmation, or is the same datagram once more.
        """
        found = self._recent.get(key)
        if found is None:
            return None
        age = now - found.time
        doubled = sequence == found.sequence and age <= DOUBLED and self._counts(key, sequence)
        repeated = doubled or (confirmation > found.confirmation and age <= MEMORY)
        return found.verdict if repeated else None

    def _counts(self, key: Key, sequence: int) -> bool:
        """Whether no other command that came since from the same sender has the same sequence number."""
        for other, since in reversed(self._recent.items()):
            if other == key:
                break
            if other.sender == key.sender and since.sequence == sequence:
                return False
        return True

    def store(self, key: Key, sequence: int, confirmation: int, verdict: Verdict, now: float) -> None:
        """Remember a command's result."""
        self._recent.pop(key, None)
        self._recent[key] = _Remembered(now, sequence, confirmation, verdict)
        while len(self._recent) > _MOST_REMEMBERED:
            self._recent.popitem(last=False)
