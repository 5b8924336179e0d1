"""What every link does."""

from __future__ import annotations

from typing import Protocol

LONGEST_WAIT = 0.1
"""A wait is cut to this (s), so that a process notices soon that it is asked to stop."""


class Link(Protocol):
    """A datagram link to one peer."""

    reliable: bool
    """Whether the link itself repeats what is lost (TCP)."""

    def send(self, datagram: bytes) -> None:
        """Send to the peer; without a peer yet, or one that is gone, the datagram is lost."""

    def receive(self, until: float) -> bytes | None:
        """The next datagram; None when `time.monotonic()` reaches `until` first, or after LONGEST_WAIT."""

    def close(self) -> None:
        """Free the port."""
