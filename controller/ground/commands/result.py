"""What a service says to a request, and what it says to everybody."""

from __future__ import annotations

from typing import NamedTuple

from pymavlink.dialects.v20 import common as mavlink

ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
REJECTED_FOR_NOW: int = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
DENIED: int = mavlink.MAV_RESULT_DENIED
FAILED: int = mavlink.MAV_RESULT_FAILED
UNSUPPORTED_FRAME = 9
"""MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME of the current `common` dialect"""
UNSUPPORTED: int = mavlink.MAV_RESULT_UNSUPPORTED

EMERGENCY: int = mavlink.MAV_SEVERITY_EMERGENCY
CRITICAL: int = mavlink.MAV_SEVERITY_CRITICAL
WARNING: int = mavlink.MAV_SEVERITY_WARNING
INFO: int = mavlink.MAV_SEVERITY_INFO


class Verdict(NamedTuple):
    """MAV_RESULT of a request; a refusal has a text that says why and what would help."""

    result: int
    text: str = ""

    @property
    def ok(self) -> bool:
        """Whether the request took effect."""
        return self.result == ACCEPTED


OK = Verdict(ACCEPTED)


def deny(text: str) -> Verdict:
    """A refusal that stays until something else changes."""
    return Verdict(DENIED, text)


def not_now(text: str) -> Verdict:
    """A refusal of something that may be asked again."""
    return Verdict(REJECTED_FOR_NOW, text)


class Notice(NamedTuple):
    """A STATUSTEXT to be."""

    severity: int
    text: str
