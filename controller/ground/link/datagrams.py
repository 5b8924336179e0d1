"""Frames out of datagrams, also of a frame that a sender has split over two of them."""

from __future__ import annotations

from collections import OrderedDict

from controller.ground.link.peers import Address
from sitl_bridge.mavlink.framing import Frame, split

MOST_SENDERS = 32
"""Addresses whose unfinished frame is kept; the one that was silent longest is forgotten"""
_MOST_BYTES = 0xFFFF - 512


class DatagramSplitter:
    """Keeps of each address the beginning of a frame that its last datagram ended with."""

    def __init__(self) -> None:
        self._rests: OrderedDict[Address, bytes] = OrderedDict()

    def frames(self, datagram: bytes, address: Address) -> list[Frame]:
        """The good frames that a datagram brings or completes."""
        found = split(self._rests.pop(address, b"") + datagram[:_MOST_BYTES])
        if found.rest:
            self._rests[address] = found.rest
            if len(self._rests) > MOST_SENDERS:
                self._rests.popitem(last=False)
        return found.frames
