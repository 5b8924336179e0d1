"""What is sent to peers: framed for each, from the vehicle or from the load, texts in pieces."""

from __future__ import annotations

import re
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.commands.result import WARNING, Notice
from controller.ground.link.packing import packed
from controller.ground.link.peers import Peer, Peers
from controller.ground.link.signing import Signing
from controller.ground.telemetry.vehicle_state import Profile
from sitl_bridge.ids import COMPONENT_AUTOPILOT, COMPONENT_LOAD, COMPONENT_WINCH

TEXT_LENGTH = 50
"""Characters of one STATUSTEXT; longer texts go in pieces"""
TEXT_PAUSE = 2.0
"""s, in which the same text, whatever its numbers, is not said twice to a peer"""
_NUMBER = re.compile(r"-?\d+(\.\d+)?")
Source = tuple[int, int]
"""MAVLink system and component"""
_MOST_TEXTS = 64
"""Texts that are remembered for that"""


class Outbox:
    """Fills the queues of peers."""

    def __init__(self, peers: Peers, profile: Profile, signing: Signing | None) -> None:
        self.vehicle = (profile.system, COMPONENT_AUTOPILOT)
        self.load = (profile.load_system, COMPONENT_LOAD)
        self.winch = (profile.system, COMPONENT_WINCH)
        self._peers = peers
        self._signing = signing

    def send(self, peer: Peer, message: Any, now: float, sender: Source | None = None) -> None:
        """A message to one peer, by default the vehicle's; one whose numbers do not fit is not sent."""
        as_packed = packed(message)
        if as_packed is not None:
            peer.send(as_packed, *(sender or self.vehicle), self._signing, now)

    def broadcast(self, message: Any, now: float) -> None:
        """A message to every peer."""
        as_packed = packed(message)
        for peer in self._peers:
            self.send(peer, as_packed, now)

    def announce(self, notice: Notice, now: float) -> None:
        """A STATUSTEXT to every peer."""
        for peer in self._peers:
            self.say(peer, notice, now)

    def say(self, peer: Peer, notice: Notice, now: float) -> None:
        """A STATUSTEXT to one peer."""
        text = notice.text.encode("ascii", "replace")
        pieces = [text[i : i + TEXT_LENGTH] for i in range(0, len(text), TEXT_LENGTH)]
        number = 0
        if len(pieces) > 1:
            peer.text_id = peer.text_id % 0xFFFF + 1
            number = peer.text_id
            if len(pieces[-1]) == TEXT_LENGTH:
                pieces.append(b"")  # the receiver knows the end by a piece that is not full
        for index, piece in enumerate(pieces):
            self.send(peer, mavlink.MAVLink_statustext_message(notice.severity, piece, number, index), now)

    def say_seldom(self, peer: Peer, text: str, now: float) -> None:
        """Something that a stream of messages gives rise to again and again, with other numbers each time."""
        kind = _NUMBER.sub("#", text)
        last = peer.last_texts.get(kind)
        if last is None or now - last >= TEXT_PAUSE:
            if len(peer.last_texts) > _MOST_TEXTS:
                peer.last_texts.clear()
            peer.last_texts[kind] = now
            self.say(peer, Notice(WARNING, text), now)
