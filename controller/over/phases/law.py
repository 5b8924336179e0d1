"""From the stream of set-points to the end of the reference: the law flies."""

from __future__ import annotations

import math

import numpy as np

from controller.design.motion.ramp import smoothly_planned
from controller.law.reference import setpoint
from controller.law.state import (
    EULER_ANGLES,
    LOAD_POSITION,
    LOAD_VELOCITY,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
    Array,
)
from controller.over.flight import Flight
from controller.over.law import CompanionLaw
from controller.over.states import State

LONGEST_STATE_AGE = 0.2
"""s; older, and nothing is sent."""
LARGEST_TILT = math.radians(60.0)
LARGEST_SPEED = 15.0
"""m/s"""
STREAM_TIME = 1.2
"""s of set-points before offboard is asked for."""
STILL_SWING = math.radians(1.0)
STILL_SPEED = 0.1
"""m/s, of the load that hangs still."""
STILL_TIME = 0.5
"""s"""
LONGEST_STEADYING = 8.0
"""s, after which the reference begins in any case."""
NO_MORE = "nothing more is sent; the stack's own failsafe holds"
OTHER_MODE = "the operator, or a failsafe, took another mode: nothing more is sent"


def stream(flight: Flight, now: float) -> None:
    """Set-points come before the mode: a stack takes offboard only while they do."""
    missing = flight.source.missing(flight.telemetry, now)
    flight.missing = missing or "the state of vehicle and load"
    estimate = flight.new_estimate(now)
    if estimate is None or missing is not None:
        return
    if flight.ramp_time is None:
        flight.ramp_time = _plan(flight, estimate)
        flight.since = now
    if flight.in_mode(flight.dialect.offboard):  # ArduCopter takes off in it: set-points act at once
        flight.go(State.TAKING_OVER, now)
        return
    flight.send(flight.hover_setpoint())
    if now - flight.since > STREAM_TIME:
        flight.go(State.TAKING_OVER, now)


def _plan(flight: Flight, estimate: Array) -> float:
    """Ramp time of the reference, s. This takes tenths of a second, as does the law's first step: both come
    before anything depends on them.
    """
    path = smoothly_planned(flight.reference(estimate[LOAD_POSITION]), flight.vehicle)
    CompanionLaw(flight.vehicle, flight.stack, flight.design, path).step(estimate, 0.0)
    return float(path["ramp_time"][0])


def take_over(flight: Flight, now: float) -> None:
    """Ask for offboard on a fresh state, and fly once the stack is in it."""
    flight.missing = "the stack to accept offboard"
    flight.note_acks("offboard")
    estimate = flight.new_estimate(now)
    if estimate is None:
        return
    if flight.in_mode(flight.dialect.offboard):
        _engage(flight, estimate, now)
        return
    flight.send(flight.hover_setpoint())
    if flight.due(now):
        flight.ask_for_mode(flight.dialect.offboard)


def _engage(flight: Flight, estimate: Array, now: float) -> None:
    """The law takes over: the load comes to rest below the vehicle first."""
    below = estimate[VEHICLE_POSITION].copy()
    below[2] = estimate[LOAD_POSITION][2]
    x, y, z = estimate[LOAD_POSITION].tolist()
    east, north, up = below.tolist()
    path = setpoint((east, north, up), (x, y, z))
    path["yaw"] = estimate[EULER_ANGLES][2]
    flight.law = CompanionLaw(flight.vehicle, flight.stack, flight.design, path)
    flight.begin_time, flight.still_since = flight.stack_time, None
    flight.say("took over: taking the swing out")
    flight.go(State.STEADYING, now)
    flight.fly(estimate)


def steady(flight: Flight, now: float) -> None:
    """Hold the load until it hangs still, which a stack's own hold does not care for; then begin."""
    estimate = _fit_estimate(flight, now)
    if estimate is None:
        return
    away = estimate[LOAD_POSITION] - estimate[VEHICLE_POSITION]
    swing = math.atan2(math.hypot(away[0], away[1]), -away[2])
    if swing > STILL_SWING or float(np.linalg.norm(estimate[LOAD_VELOCITY])) > STILL_SPEED:
        flight.still_since = None
    elif flight.still_since is None:
        flight.still_since = now
    still = flight.still_since is not None and now - flight.still_since > STILL_TIME
    if still or now - flight.since > LONGEST_STEADYING:
        _begin(flight, now)
    flight.fly(estimate)


def _begin(flight: Flight, now: float) -> None:
    """The reference begins where the load is held; what the law has integrated stays."""
    assert flight.law is not None
    assert flight.ramp_time is not None
    path = flight.reference(flight.law.reference)
    path["ramp_time"], path["yaw"] = flight.ramp_time, flight.law.path["yaw"]
    if flight.live is not None:
        path = flight.live.start(flight.law.reference, float(path["yaw"][0]))
    flight.law.path, flight.begin_time = path, flight.stack_time
    flight.say("flying the load")
    flight.go(State.FLYING, now)


def fly(flight: Flight, now: float) -> None:
    """A step for each state of the stack, to the end of the reference."""
    estimate = _fit_estimate(flight, now)
    if estimate is None:
        return
    flight.fly(estimate)
    assert flight.begin_time is not None
    if flight.stack_time - flight.begin_time >= flight.duration_s:
        flight.say("the reference is over: handing back")
        flight.go(State.HANDING_BACK, now)


def _fit_estimate(flight: Flight, now: float) -> Array | None:
    """A new state to fly on; None: there is no new one, or the flight has failed."""
    if not flight.in_mode(flight.dialect.offboard):
        flight.fail(OTHER_MODE, now)
        return None
    estimate = flight.new_estimate(now)
    why = unfit(flight, estimate, now)
    if why is not None:
        flight.fail(f"{why}: {NO_MORE}", now)
        return None
    return estimate


def unfit(flight: Flight, estimate: Array | None, now: float) -> str | None:
    """Why the law must not go on; None: it may."""
    if flight.state_age(now) > LONGEST_STATE_AGE:
        return f"the stack's state is older than {LONGEST_STATE_AGE} s"
    if flight.ages.age("estimate", now) > LONGEST_STATE_AGE:
        what = flight.source.missing(flight.telemetry, now) or "nothing is known of it"
        return f"the load's state is older than {LONGEST_STATE_AGE} s ({what})"
    if estimate is None:
        return None
    roll, pitch, _ = estimate[EULER_ANGLES].tolist()
    tilt = math.acos(min(1.0, max(-1.0, math.cos(roll) * math.cos(pitch))))
    if tilt > LARGEST_TILT:
        return f"the vehicle tilts by {math.degrees(tilt):.0f}°, {math.degrees(LARGEST_TILT):.0f}° at most"
    speed = float(np.linalg.norm(estimate[VEHICLE_VELOCITY]))
    if speed > LARGEST_SPEED:
        return f"the vehicle flies {speed:.0f} m/s, {LARGEST_SPEED:g} m/s at most"
    return None
