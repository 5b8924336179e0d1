"""A serial line as a link of whole MAVLink frames (pyserial)."""

from __future__ import annotations

import contextlib
import os
import select
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from sitl_bridge.mavlink.framing import LARGEST_DATAGRAM, StreamSplitter
from sitl_bridge.mavlink.links.link import LONGEST_WAIT

if TYPE_CHECKING:
    import serial

RETRY_INTERVAL = 0.5
"""s between two attempts to open a device that has gone."""
MOST_UNSENT = 1 << 14
"""Bytes that wait for a slow line before further datagrams are lost."""


class SerialLink:
    """A flight controller's serial port or USB. An unplugged device is opened again once it is back."""

    reliable = False

    def __init__(self, device: str, baud: int, say: Callable[[str], None]) -> None:
        """Raises OSError, naming the device, when it cannot be opened."""
        self._device, self._baud, self._say = device, baud, say
        self._unsent = b""
        self._next_attempt = 0.0
        self._splitter = StreamSplitter()
        self._port: serial.Serial | None = self._open()

    def _open(self) -> serial.Serial:
        import serial

        try:
            port = serial.Serial(self._device, self._baud, timeout=0, write_timeout=0, exclusive=True)
        except serial.SerialException as error:
            reason = os.strerror(error.errno) if error.errno else str(error)
            raise OSError(f"serial:{self._device}:{self._baud} cannot be opened: {reason}") from None
        except ValueError as error:  # a baud rate that there is not
            raise OSError(f"serial:{self._device}:{self._baud} cannot be opened: {error}") from None
        os.set_blocking(port.fileno(), False)
        return port

    def send(self, datagram: bytes) -> None:
        """Send; what a slow line cannot take any more is lost."""
        if self._port is not None and len(self._unsent) < MOST_UNSENT:
            self._unsent += datagram
            self._flush()

    def _flush(self) -> None:
        assert self._port is not None
        try:
            sent = os.write(self._port.fileno(), self._unsent)
        except BlockingIOError:
            return
        except OSError:
            self._lose()
            return
        self._unsent = self._unsent[sent:]

    def receive(self, until: float) -> bytes | None:
        """Whole frames, or None when `time.monotonic()` reaches `until` first, or after LONGEST_WAIT."""
        until = min(until, time.monotonic() + LONGEST_WAIT)
        while True:
            if self._port is None:
                self._reopen(until)
            else:
                frames = self._read(until)
                if frames:
                    return frames
            if time.monotonic() >= until:
                return None

    def _read(self, until: float) -> bytes:
        assert self._port is not None
        descriptor = self._port.fileno()
        writers = [descriptor] if self._unsent else []
        wait = max(0.0, until - time.monotonic())
        readable, writable, _ = select.select([descriptor], writers, [], wait)
        if writable:
            self._flush()
        if not readable or self._port is None:
            return b""
        try:
            data = os.read(descriptor, LARGEST_DATAGRAM)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._lose()
            return b""
        return b"".join(frame.raw for frame in self._splitter.receive(data))

    def _lose(self) -> None:
        self.close()
        self._say(f"{self._device} is disconnected: waiting for it")

    def _reopen(self, until: float) -> None:
        wait = min(self._next_attempt, until) - time.monotonic()
        if wait > 0.0:
            time.sleep(wait)
        if time.monotonic() < self._next_attempt:
            return
        self._next_attempt = time.monotonic() + RETRY_INTERVAL
        with contextlib.suppress(OSError):
            self._port = self._open()
            self._say(f"{self._device} is back")

    def close(self) -> None:
        """Free the device."""
        if self._port is not None:
            self._port.close()
        self._port, self._unsent, self._splitter = None, b"", StreamSplitter()
