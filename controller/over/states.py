"""Where a flight over a stack is."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from controller.law.state import Array


class State(Enum):
    """Where a flight is, in words."""

    CONNECTING = "waiting for the stack"
    PREPARING = "waiting for the vehicle's and the load's state"
    ARMING = "arming"
    TAKING_OFF = "taking off"
    STREAMING = "streaming set-points"
    TAKING_OVER = "taking over"
    STEADYING = "taking the swing out"
    FLYING = "flying the load"
    HANDING_BACK = "handing back"
    LANDING = "landing"
    DONE = "landed"
    FAILED = "failed"


class Step(NamedTuple):
    """One step of the law."""

    time_s: float
    """Since the reference began, by the stack's clock."""
    state: Array
    """(18,), eq. 31."""
    reference: Array
    """(3,), m: where the load is to be."""
