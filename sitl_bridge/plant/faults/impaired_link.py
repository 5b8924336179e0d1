"""A link with faults: the datagrams of a real one, lost, late, doubled, overtaken or held back, seeded."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from sitl_bridge.mavlink.links.link import Link
from sitl_bridge.plant.faults.impairments import FaultyPath
from sitl_bridge.plant.faults.schedule import LinkFault


class FaultyLink:
    """Carries datagrams over a link through a `FaultyPath` each way.

    Faults are timed in wall time since the scenario began, also in lockstep: a stall in simulated time would
    hold back the very answer that lets simulated time go on.
    """

    reliable = False

    def __init__(
        self, link: Link, faults: Sequence[LinkFault], seed: int, began_at: Callable[[], float | None]
    ) -> None:
        """began_at: `time.monotonic()` of the scenario's beginning, None before it."""
        self._link = link
        self._began_at = began_at
        self._outward = FaultyPath(faults, "to_autopilot", seed)
        self._homeward = FaultyPath(faults, "to_plant", seed)
        self._arrived: list[bytes] = []

    def send(self, datagram: bytes) -> None:
        """Send, now, later, twice, or not at all."""
        now = self._now()
        if now is None:
            self._link.send(datagram)
            return
        self._outward.receive(datagram, now)
        self._forward(now)

    def receive(self, until: float) -> bytes | None:
        """The next datagram that arrives, or None; sends what is due in the meantime."""
        if self._arrived:
            return self._arrived.pop(0)
        now = self._now()
        if now is None:
            return self._link.receive(until)
        self._forward(now)
        received = self._link.receive(self._wait_until(until))
        now = self._now() or now
        if received is not None:
            self._homeward.receive(received, now)
        self._forward(now)
        self._arrived += self._homeward.to_send(now)
        return self._arrived.pop(0) if self._arrived else None

    def close(self) -> None:
        """Free the port."""
        self._link.close()

    def _now(self) -> float | None:
        """Seconds since the scenario began."""
        began = self._began_at()
        return None if began is None else time.monotonic() - began

    def _forward(self, now: float) -> None:
        for datagram in self._outward.to_send(now):
            self._link.send(datagram)

    def _wait_until(self, until: float) -> float:
        """`time.monotonic()` of whatever comes first: the caller's deadline or a datagram under way."""
        began = self._began_at() or 0.0
        due = [path.next_deadline() for path in (self._outward, self._homeward)]
        return min(until, *(began + time_s for time_s in due if time_s is not None), float("inf"))
