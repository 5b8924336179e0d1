"""What the companion does in each phase: `PHASES[state](flight, now)`, called whenever there is time.

A phase reads the flight's telemetry, sends through it, and says by `go` or `fail` how it goes on.
"""

from __future__ import annotations

from collections.abc import Callable

from controller.over.flight import Flight
from controller.over.phases.before import arm, connect, prepare, take_off
from controller.over.phases.land import hand_back, land
from controller.over.phases.law import fly, steady, stream, take_over
from controller.over.states import State


def _over(flight: Flight, now: float) -> None:
    """Nothing more."""


PHASES: dict[State, Callable[[Flight, float], None]] = {
    State.CONNECTING: connect,
    State.PREPARING: prepare,
    State.ARMING: arm,
    State.TAKING_OFF: take_off,
    State.STREAMING: stream,
    State.TAKING_OVER: take_over,
    State.STEADYING: steady,
    State.FLYING: fly,
    State.HANDING_BACK: hand_back,
    State.LANDING: land,
    State.DONE: _over,
    State.FAILED: _over,
}
PATIENCE = {
    State.ARMING: 60.0,
    State.TAKING_OFF: 90.0,
    State.STREAMING: 30.0,
    State.TAKING_OVER: 10.0,
    State.HANDING_BACK: 10.0,
    State.LANDING: 120.0,
}
"""s in a phase after which the flight has failed; the first two phases last as long as one waits for them."""
