"""The load's own messages, passed on from the plant's link, and the load as traffic for QGroundControl."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.link.outbox import Outbox
from controller.ground.link.packing import Packed, decoded, packed
from controller.ground.link.peers import Address, Peer
from controller.ground.telemetry.vehicle_state import Profile
from sitl_bridge.mavlink.framing import Frame
from sitl_bridge.mavlink.traffic import load_traffic

LOAD_SILENCE = 2.0
"""s after which the load's last message is too old to be passed on"""
_RATES = {mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 5.0}
"""Hz, at most, at which the load's own messages are passed on"""


class LoadRelay:
    """The latest that the load has said, and to whom it was passed on when."""

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._latest: dict[int, tuple[Packed, float]] = {}
        self._sent: dict[tuple[Address, int], float] = {}

    def accept(self, frame: Frame, now: float) -> bool:
        """A frame from the plant; whether it was the load's and is to be passed on."""
        if frame.system != self._profile.load_system or frame.message_id not in _RATES:
            return False
        message = decoded(frame)
        as_packed = None if message is None else packed(message)
        if as_packed is not None:
            self._latest[frame.message_id] = (as_packed, now)
        return as_packed is not None

    def forget(self, address: Address) -> None:
        """A peer is gone."""
        for key in [key for key in self._sent if key[0] == address]:
            del self._sent[key]

    def pass_on(self, peer: Peer, out: Outbox, now: float) -> None:
        """Send a peer what is new and due."""
        for message_id, (message, time) in self._latest.items():
            last = self._sent.get((peer.address, message_id), -math.inf)
            if time > last and now - last >= 0.999 / _RATES[message_id]:
                self._sent[peer.address, message_id] = now
                out.send(peer, message, now, out.load)

    def as_traffic(self, now: float) -> Any:
        """ADSB_VEHICLE for the load, which QGroundControl draws no other way; None while it is silent."""
        found = self._latest.get(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
        if found is None or now - found[1] > LOAD_SILENCE:
            return None
        place = mavlink.MAVLink_global_position_int_message
        return load_traffic(self._profile.instance, place(*place.unpacker.unpack(found[0].payload)))
