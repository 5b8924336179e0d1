"""A link that loses datagrams, seeded: for `--drop`."""

from __future__ import annotations

import random

from sitl_bridge.mavlink.links.link import Link


class LossyLink:
    """Drops each datagram, sent or received, with a given chance."""

    reliable = False

    def __init__(self, link: Link, drop_percent: float, seed: int) -> None:
        self._link = link
        self._chance = drop_percent / 100.0
        self._sending = random.Random(f"{seed} sending")
        self._receiving = random.Random(f"{seed} receiving")

    def send(self, datagram: bytes) -> None:
        """Send, perhaps."""
        if self._sending.random() >= self._chance:
            self._link.send(datagram)

    def receive(self, until: float) -> bytes | None:
        """The next datagram that is not dropped, or None."""
        while (datagram := self._link.receive(until)) is not None:
            if self._receiving.random() >= self._chance:
                return datagram
        return None

    def close(self) -> None:
        """Free the port."""
        self._link.close()
