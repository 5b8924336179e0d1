"""Messages to bytes, MAVLink 2 or 1, and the messages that pymavlink's `common` does not have yet."""

from __future__ import annotations

import binascii
import struct
from typing import Any, NamedTuple

from pymavlink.dialects.v10 import common as v1
from pymavlink.dialects.v20 import common as mavlink

from sitl_bridge.mavlink.framing import FLAG_SIGNED, MAGIC_V1, MAGIC_V2, Frame, decode

_BITS_REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
_V1_LENGTHS: dict[int, int] = {number: kind.unpacker.size for number, kind in v1.mavlink_map.items()}
"""Bytes of payload by message number. Read at start-up, by 20 ms: the control loop has no time for it."""


def checksum(data: bytes) -> int:
    """CRC-16/MCRF4XX: the reflected form of the CCITT polynomial that the standard library has."""
    crc = binascii.crc_hqx(data.translate(_BITS_REVERSED), 0xFFFF)
    return _BITS_REVERSED[crc >> 8] | _BITS_REVERSED[crc & 0xFF] << 8


class AvailableModes(mavlink.MAVLink_message):  # type: ignore[misc]
    """AVAILABLE_MODES (435) of the current `common` dialect."""

    id = 435
    crc_extra = 134
    _layout = struct.Struct("<IIBBB35s")

    def __init__(
        self, count: int, index: int, standard: int, custom: int, properties: int, name: str
    ) -> None:
        super().__init__(self.id, "AVAILABLE_MODES")
        self._fields = (custom, properties, count, index, standard, name.encode())

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """As pymavlink's generated messages do."""
        return bytes(self._pack(mav, self.crc_extra, self._layout.pack(*self._fields), force_mavlink1))


class CurrentMode(mavlink.MAVLink_message):  # type: ignore[misc]
    """CURRENT_MODE (436) of the current `common` dialect."""

    id = 436
    crc_extra = 193
    _layout = struct.Struct("<IIB")

    def __init__(self, standard: int, custom: int, intended: int) -> None:
        super().__init__(self.id, "CURRENT_MODE")
        self._fields = (custom, intended, standard)

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """As pymavlink's generated messages do."""
        return bytes(self._pack(mav, self.crc_extra, self._layout.pack(*self._fields), force_mavlink1))


class FigureEightStatus(mavlink.MAVLink_message):  # type: ignore[misc]
    """FIGURE_EIGHT_EXECUTION_STATUS (361) of the current `common` dialect."""

    id = 361
    crc_extra = 93
    _layout = struct.Struct("<QfffiifB")

    def __init__(
        self,
        time_usec: int,
        major: float,
        minor: float,
        orientation: float,
        frame: int,
        place: tuple[int, int, float],
    ) -> None:
        """Radii in m, orientation in rad from north, place as the frame says."""
        super().__init__(self.id, "FIGURE_EIGHT_EXECUTION_STATUS")
        self._fields = (time_usec, major, minor, orientation, *place, frame)

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """As pymavlink's generated messages do."""
        return bytes(self._pack(mav, self.crc_extra, self._layout.pack(*self._fields), force_mavlink1))


class ProtocolVersion(mavlink.MAVLink_message):  # type: ignore[misc]
    """PROTOCOL_VERSION (300), which older clients ask for: MAVLink 1 is heard, 2 is spoken."""

    id = 300
    crc_extra = 217
    _layout = struct.Struct("<HHH8s8s")

    def __init__(self) -> None:
        super().__init__(self.id, "PROTOCOL_VERSION")

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """As pymavlink's generated messages do."""
        payload = self._layout.pack(200, 100, 200, b"", b"")
        return bytes(self._pack(mav, self.crc_extra, payload, force_mavlink1))


class ComponentMetadata(mavlink.MAVLink_message):  # type: ignore[misc]
    """COMPONENT_METADATA (397) of the current `common` dialect: where the general metadata file is."""

    id = 397
    crc_extra = 182
    _layout = struct.Struct("<II100s")

    def __init__(self, time_boot_ms: int, file_crc: int, uri: str) -> None:
        super().__init__(self.id, "COMPONENT_METADATA")
        self._fields = (time_boot_ms, file_crc, uri.encode())

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """As pymavlink's generated messages do."""
        return bytes(self._pack(mav, self.crc_extra, self._layout.pack(*self._fields), force_mavlink1))


class ComponentInformation(mavlink.MAVLink_message):  # type: ignore[misc]
    """COMPONENT_INFORMATION (395), which older clients ask for instead; there are no peripherals."""

    id = 395
    crc_extra = 0
    _layout = struct.Struct("<III100s100s")

    def __init__(self, time_boot_ms: int, file_crc: int, uri: str) -> None:
        super().__init__(self.id, "COMPONENT_INFORMATION")
        self._fields = (time_boot_ms, file_crc, 0, uri.encode(), b"")

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """As pymavlink's generated messages do."""
        return bytes(self._pack(mav, self.crc_extra, self._layout.pack(*self._fields), force_mavlink1))


def payload_of(message: Any) -> bytes:
    """The untruncated payload of a pymavlink message. Raises struct.error if a field does not fit."""
    message._pack = lambda _mav, _extra, payload, force_mavlink1=False: payload
    try:
        return bytes(message.pack(None))
    finally:
        del message._pack


def decoded(frame: Frame) -> Any | None:
    """The message of a frame; None if its payload cannot be read."""
    try:
        return decode(frame)
    except (mavlink.MAVError, struct.error, ValueError):
        return None


class Packed(NamedTuple):
    """A message as payload, ready to be framed for any peer."""

    payload: bytes
    message_id: int
    crc_extra: int


def packed(message: Any) -> Packed | None:
    """Pack a message's fields, or pass on what is packed; None if a number does not fit its field."""
    if isinstance(message, Packed):
        return message
    try:
        return Packed(payload_of(message), message.get_msgId(), message.crc_extra)  # `id` may be a field
    except (struct.error, OverflowError, ValueError):
        return None


def frame(
    payload: bytes, message_id: int, crc_extra: int, sequence: int, system: int, component: int, signed: bool
) -> bytes:
    """A MAVLink 2 frame, without the signature that has to follow if `signed`."""
    payload = payload.rstrip(b"\0") or payload[:1]
    header = struct.pack(
        "<BBBBBBHB",
        len(payload),
        FLAG_SIGNED if signed else 0,
        0,
        sequence,
        system,
        component,
        message_id & 0xFFFF,
        message_id >> 16,
    )
    body = header + payload
    return b"%c%b%b" % (MAGIC_V2, body, checksum(body + bytes((crc_extra,))).to_bytes(2, "little"))


def frame_v1(
    payload: bytes, message_id: int, crc_extra: int, sequence: int, system: int, component: int
) -> bytes | None:
    """A MAVLink 1 frame: extension fields cut off. None if MAVLink 1 has no such message."""
    length = _V1_LENGTHS.get(message_id)
    if length is None:
        return None
    payload = payload[:length]
    body = bytes((len(payload), sequence, system, component, message_id)) + payload
    return b"%c%b%b" % (MAGIC_V1, body, checksum(body + bytes((crc_extra,))).to_bytes(2, "little"))
