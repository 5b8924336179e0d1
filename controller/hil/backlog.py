"""What came from the plant while this process stood still, and what the rotors did meanwhile.

In real time the plant does not wait. Of the ticks that lie in the socket only the last can be answered in
time. For those before it the plant has gone by its own rule: it flies the last command on, and after
ROTORS_STOP_AFTER stops the rotors. In lockstep no tick follows one that is not answered.
"""

from __future__ import annotations

import time
from collections import deque

from controller.law.state import Array
from sitl_bridge.frames import MICROSECONDS_PER_SECOND
from sitl_bridge.mavlink.hil import ROTORS_STOP_AFTER
from sitl_bridge.mavlink.links.link import Link

STALL = 0.05
"""s without a datagram, after which it is looked whether more than one has come."""
WATCHFUL = 250
"""Datagrams after that: a backlog may still be on its way while its first ones are answered."""
_STOP_AFTER_USEC = round(ROTORS_STOP_AFTER * MICROSECONDS_PER_SECOND)


class Inlet:
    """Receives from a link, and after a pause takes out all that waits there, to know how much it is."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._heard = time.monotonic()
        self._watchful = 0  # datagrams, behind which it is looked for more
        self._waiting: deque[bytes] = deque()
        self._found: list[bytes] = []

    def receive(self, until: float) -> bytes | None:
        """The next datagram, see `Link.receive`."""
        if self._waiting:
            received = self._waiting.popleft()
        else:
            came = self._link.receive(until)
            if came is None:
                return None
            received, now = came, time.monotonic()
            if now - self._heard > STALL:
                self._watchful = WATCHFUL
            self._heard = now
        if self._watchful > 0 and not self._waiting:
            self._watchful -= 1
            self._take_all()
        return received

    def found(self) -> list[bytes]:
        """Datagrams that have come behind the one received last, each told of once."""
        if not self._found:
            return self._found
        found, self._found = self._found, []
        return found

    def _take_all(self) -> None:
        while (datagram := self._link.receive(0.0)) is not None:
            self._found.append(datagram)
        self._waiting.extend(self._found)


class Silence:
    """What the rotors do from the last answer that came in time."""

    def __init__(self, controls: Array, since_usec: int) -> None:
        """controls: (16,), of that answer; since_usec: the plant's time of its tick."""
        self._controls = controls.copy()
        self._stop_usec = since_usec + _STOP_AFTER_USEC

    def controls(self, time_usec: int) -> Array | None:
        """Controls (16,) that act from a tick on; None: the rotors are stopped."""
        return self._controls if time_usec < self._stop_usec else None
