"""Who is served: every address that speaks, each with its own version, sequence, queue and streams."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import NamedTuple

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.link.packing import Packed, frame, frame_v1
from controller.ground.link.ports import ONBOARD_LINK
from controller.ground.link.signing import Signing
from controller.ground.telemetry.message_rates import Streams
from sitl_bridge.mavlink.framing import Frame

HEARTBEAT: int = mavlink.MAVLINK_MSG_ID_HEARTBEAT
SILENCE = 30.0
"""s after which a peer that says nothing is forgotten; the standard ones start afresh."""
MOST_PEERS = 16
"""Peers at once; another takes the place of one that is not, or no more, a client by its HEARTBEAT."""
QUIET = 5.0
"""s without a frame after which a peer that has sent HEARTBEATs may lose its place"""
LONGEST_QUEUE = 1000
"""Frames waiting for one peer; more are dropped, the oldest first."""


class Address(NamedTuple):
    """Where a peer is: one of our links (0: ground stations, 1: onboard) and its own host and port."""

    link: int
    """STATION_LINK or ONBOARD_LINK"""
    host: str
    port: int


class Peer:
    """What is known of one address, and what waits to be sent to it."""

    def __init__(self, address: Address, standard: bool, now: float) -> None:
        self.address = address
        self.standard = standard
        self.restart(now)

    def restart(self, now: float) -> None:
        """Forget everything: a new client is behind the address, or none yet."""
        self.heard = False
        self.last_heard = now
        self.beats = False
        """Whether it has sent a HEARTBEAT, as every lasting client does"""
        self.version = 0
        """Largest MAVLink version heard; 0 until then, which is answered in version 2."""
        self.streams = Streams(now, onboard=self.address.link == ONBOARD_LINK)
        self.queue: deque[bytes] = deque(maxlen=LONGEST_QUEUE)
        self.sequences: dict[tuple[int, int], int] = {}
        self.text_id = 0
        self.last_texts: dict[str, float] = {}
        """When a text was said last that must not be said at every message, by its kind"""

    def hear(self, frame: Frame, now: float) -> None:
        """Note that a good frame came."""
        self.heard = True
        self.last_heard = now
        self.beats = self.beats or frame.message_id == HEARTBEAT
        self.version = max(self.version, frame.version)

    def send(self, message: Packed, system: int, component: int, signing: Signing | None, now: float) -> None:
        """Frame a message for this peer, from one of our components, and queue it."""
        source = (system, component)
        sequence = self.sequences.get(source, 0)
        if self.version == 1 and signing is None:
            raw = frame_v1(*message, sequence, system, component)
            if raw is None:
                return
        else:
            raw = frame(*message, sequence, system, component, signing is not None)
            if signing is not None:
                raw = signing.sign(raw, self.address.link, now)
        self.sequences[source] = sequence + 1 & 0xFF
        self.queue.append(raw)

    @property
    def speaks_v1(self) -> bool:
        """Whether it has spoken MAVLink 1 only."""
        return self.version == 1


class Peers:
    """The table of peers: the standard ones, which are spoken to first, and whoever speaks."""

    def __init__(
        self, standard: tuple[Address, ...], now: float, forgotten: Callable[[Address], None]
    ) -> None:
        """forgotten: told of every peer whose state is given up."""
        self._table = {address: Peer(address, True, now) for address in standard}
        self._forgotten = forgotten
        self.last_station: float | None = None
        """When any ground station was last heard by its heartbeat, be its peer forgotten or not."""

    def __iter__(self) -> Iterator[Peer]:
        return iter(self._table.values())

    def find(self, address: Address, now: float) -> Peer | None:
        """The peer at an address, a new one if there is room or can be made, else None."""
        peer = self._table.get(address)
        if peer is None and (len(self._table) < MOST_PEERS or self._make_room(now)):
            peer = self._table[address] = Peer(address, False, now)
        return peer

    def _make_room(self, now: float) -> bool:
        """Give up the peer that is least missed: one without HEARTBEATs, of these the one silent longest."""
        idle = [p for p in self if not p.standard and not (p.beats and now - p.last_heard <= QUIET)]
        if not idle:
            return False
        least = min(idle, key=lambda peer: (peer.beats, peer.last_heard))
        del self._table[least.address]
        self._forgotten(least.address)
        return True

    def forget_silent(self, now: float) -> None:
        """Forget peers that have been silent for too long."""
        silent = [peer for peer in self if peer.heard and now - peer.last_heard > SILENCE]
        for peer in silent:
            if peer.standard:
                peer.restart(now)
            else:
                del self._table[peer.address]
            self._forgotten(peer.address)
