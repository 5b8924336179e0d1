"""The companion's side of the link to a flight stack, as a protocol object without I/O.

It waits for the stack, arms it and takes off, streams set-points, takes over in offboard, flies the
reference, hands back and lands. It stops sending when the stack's state is old, the vehicle is out of its
envelope, or the operator has taken another mode. The stack's own failsafe then holds.
"""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import common as mavlink

from controller.over.flight import Flight
from controller.over.phases import PATIENCE, PHASES
from controller.over.states import State
from sitl_bridge.mavlink.framing import split

HEARTBEAT_INTERVAL = 0.5
REMINDER_INTERVAL = 10.0
"""s between two lines that say what is waited for."""


class Companion:
    """Carries a flight's bytes and time."""

    def __init__(self, flight: Flight, wait_s: float = math.inf) -> None:
        """wait_s: how long to wait for the stack, and then for its state."""
        self.flight = flight
        self._patience = {State.CONNECTING: wait_s, State.PREPARING: wait_s, **PATIENCE}
        self._next_heartbeat = self._next_reminder = self._wake = 0.0
        self._started = False

    @property
    def over(self) -> bool:
        """Whether there is nothing more to do."""
        return self.flight.state in (State.DONE, State.FAILED)

    def next_deadline(self) -> float:
        """When `to_send` has something at the latest."""
        return self._wake

    def receive(self, datagram: bytes, now: float) -> None:
        """Take in what a link brings."""
        for frame in split(datagram).frames:
            self.flight.telemetry.take(frame, now)
            self.flight.source.hear(frame, now)
        if self.flight.telemetry.vehicle_at == now:
            self.flight.ages.mark("state", now)

    def to_send(self, now: float) -> list[bytes]:
        """What is due: HEARTBEAT, commands, and a set-point for each new state of the stack."""
        flight = self.flight
        if not self._started:
            self._started, flight.since = True, now
            self._next_reminder = now + REMINDER_INTERVAL
        if now >= self._next_heartbeat:
            self._next_heartbeat = now + HEARTBEAT_INTERVAL
            flight.pack(
                mavlink.MAVLink_heartbeat_message(
                    mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3
                )
            )
            flight.pack(mavlink.MAVLink_timesync_message(0, round(now * 1e9)))
        while flight.telemetry.texts:
            flight.say(f"the stack says: {flight.telemetry.texts.popleft()}")
        PHASES[flight.state](flight, now)
        self._watch_patience(now)
        self._wake = min(self._next_heartbeat, flight.next_try if flight.next_try > now else math.inf)
        out, flight.out = flight.out, []
        return out

    def _watch_patience(self, now: float) -> None:
        flight = self.flight
        patience = self._patience.get(flight.state)
        if patience is None:
            return
        waited = now - flight.since
        if waited > patience:
            flight.give_up(patience, now)
        elif now >= self._next_reminder and waited > REMINDER_INTERVAL:
            self._next_reminder = now + REMINDER_INTERVAL
            flight.say(f"still waiting for {flight.missing or flight.state.value}")
