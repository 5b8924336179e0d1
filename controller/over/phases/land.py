"""After the reference: the stack holds, lands and disarms."""

from __future__ import annotations

from pymavlink.dialects.v20 import common as mavlink

from controller.over.flight import Flight
from controller.over.phases.law import OTHER_MODE, unfit
from controller.over.states import State


def hand_back(flight: Flight, now: float) -> None:
    """The law goes on until the stack holds: there is no gap between the two."""
    flight.missing = "the stack to hold"
    flight.note_acks("handing back")
    if flight.in_mode(flight.dialect.hold):
        flight.go(State.LANDING, now)
        return
    if not flight.in_mode(flight.dialect.offboard):
        flight.fail(OTHER_MODE, now)
        return
    if flight.due(now):
        flight.ask_for_mode(flight.dialect.hold)
    estimate = flight.new_estimate(now)
    if unfit(flight, estimate, now) is None and estimate is not None:
        flight.fly(estimate)


def land(flight: Flight, now: float) -> None:
    """Ask for it until the stack has disarmed, or somebody else flies."""
    flight.missing = "the stack to land and disarm"
    flight.note_acks("landing")
    t, dialect = flight.telemetry, flight.dialect
    if not t.armed:
        flight.say("landed and disarmed")
        flight.go(State.DONE, now)
    elif flight.in_mode(dialect.land) or t.landed == mavlink.MAV_LANDED_STATE_ON_GROUND:
        return
    elif not flight.in_mode(dialect.hold):
        flight.fail("the operator took another mode instead of the landing", now)
    elif flight.due(now):
        flight.ask_for_mode(dialect.land)
