"""MAVLink 2 message signing: what a signed link takes, and how it signs.

The frame format is MAVLink's (and pymavlink's, which the tests check against). pymavlink's own check is not
used: it takes over a frame's time stamp before it has checked the signature, so that one forged frame with a
time stamp far ahead locks the real sender out.
"""

from __future__ import annotations

import hashlib
import hmac
from pathlib import Path

from sitl_bridge.mavlink.framing import SIGNATURE_LENGTH, Frame

EPOCH = 1420070400.0
"""Signing time stamps count from 2015-01-01, in Unix seconds."""
TICKS_PER_SECOND = 100_000
OLDEST_NEW_STREAM = 60 * TICKS_PER_SECOND
"""A sender that was never heard may be so far behind our own time stamp."""
_SIGNATURE = 6
"""Bytes of the signature proper, behind link id and time stamp."""


class KeyFileError(ValueError):
    """The key file is not 64 hexadecimal digits."""


def read_key(path: Path) -> bytes:
    """The 32-byte key of a file of 64 hexadecimal digits. Raises KeyFileError."""
    try:
        text = path.read_text(encoding="ascii").strip()
        key = bytes.fromhex(text)
    except OSError as error:
        raise KeyFileError(
            f"{path}: {error.strerror}; expected a signing key of 64 hexadecimal digits"
        ) from None
    except ValueError:
        raise KeyFileError(f"{path}: not a signing key of 64 hexadecimal digits") from None
    if len(text) != 64:
        raise KeyFileError(f"{path}: {len(text)} characters, a signing key has 64 hexadecimal digits")
    return key


class Signing:
    """The policy of one autopilot with a key: only signed MAVLink 2 comes in and goes out, nothing twice.

    Streams are told apart by link id, system and component, as the standard has it, and not by address: a
    frame that was recorded on one link is refused on every other.
    """

    def __init__(self, key: bytes, unix_time_at_zero: float) -> None:
        """unix_time_at_zero: Unix time (s) at the station's time 0, until `keep_time` says it anew."""
        self._key = key
        self._zero = unix_time_at_zero
        self._latest: dict[tuple[int, int, int], int] = {}
        self._timestamp = 0
        self.refused = 0

    def keep_time(self, now: float, unix_time: float) -> None:
        """It is `unix_time` (s): the station's clock stands still when the machine does, the senders' do not.

        Our time stamps go on from where they are when the time is set back.
        """
        self._zero = unix_time - now

    def _now(self, now: float) -> int:
        return max(self._timestamp, int((now + self._zero - EPOCH) * TICKS_PER_SECOND))

    def _digest(self, data: bytes) -> bytes:
        return hashlib.sha256(self._key + data).digest()[:_SIGNATURE]

    def accepts(self, frame: Frame, now: float) -> bool:
        """Whether a frame is signed with our key and newer than all before it; remembers it if so."""
        good = frame.signed and self._check(frame, now)
        self.refused += not good
        return good

    def _check(self, frame: Frame, now: float) -> bool:
        raw = frame.raw
        if not hmac.compare_digest(self._digest(raw[:-_SIGNATURE]), raw[-_SIGNATURE:]):
            return False
        tail = raw[-SIGNATURE_LENGTH:]
        stream = (tail[0], frame.system, frame.component)
        timestamp = int.from_bytes(tail[1:-_SIGNATURE], "little")
        latest = self._latest.get(stream, self._now(now) - OLDEST_NEW_STREAM)
        if timestamp <= latest:
            return False
        self._latest[stream] = timestamp
        self._timestamp = max(self._timestamp, timestamp)
        return True

    def sign(self, frame: bytes, link: int, now: float) -> bytes:
        """A frame that has its flag set already, with link id, time stamp and signature behind it."""
        self._timestamp = self._now(now) + 1
        head = frame + bytes((link,)) + self._timestamp.to_bytes(6, "little")
        return head + self._digest(head)
