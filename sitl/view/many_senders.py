"""A UDP port on which a vehicle and a plant may both speak: everybody is heard, and everybody is answered."""

from __future__ import annotations

import contextlib
import select
import socket
import time

from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.mavlink.links.link import LONGEST_WAIT

MOST_SENDERS = 16
"""Answered at once; a new one takes the place of the one that has been silent for longest."""
LARGEST_DATAGRAM = 65_536


class ManySenders:
    """A link to all who speak to a port."""

    reliable = False

    def __init__(self, address: Address) -> None:
        """Raises OSError, naming the address, when the port is taken."""
        self._senders: dict[tuple[str, int], None] = {}  # the one heard last is last
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((address.host, address.port))
        except OSError as error:
            self._socket.close()
            raise OSError(f"{address} cannot be opened: {error.strerror or error}") from None

    def send(self, datagram: bytes) -> None:
        """To everybody who has spoken."""
        for sender in self._senders:
            with contextlib.suppress(OSError):
                self._socket.sendto(datagram, sender)

    def receive(self, until: float) -> bytes | None:
        """The next datagram; None when `time.monotonic()` reaches `until` first, or after LONGEST_WAIT."""
        wait = min(until - time.monotonic(), LONGEST_WAIT)
        if wait > 0.0:
            select.select([self._socket], [], [], wait)
        try:
            datagram, sender = self._socket.recvfrom(LARGEST_DATAGRAM)
        except OSError:  # nothing came, or somebody who was answered is gone
            return None
        self._senders.pop(sender, None)
        self._senders[sender] = None
        if len(self._senders) > MOST_SENDERS:
            del self._senders[next(iter(self._senders))]
        return datagram

    def close(self) -> None:
        """Free the port."""
        self._socket.close()
