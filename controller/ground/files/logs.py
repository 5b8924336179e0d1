"""The flight's logs as clients see them, and the protocol LOG_REQUEST_LIST, _DATA, _END, LOG_ERASE."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.link.peers import Address

CHUNK = 90
"""Bytes of one LOG_DATA"""
AT_ONCE = 40
"""LOG_DATA messages at most each time"""
PAUSE = 0.01
"""s between two times: a burst would overflow a client's socket buffer"""
MESSAGES = (
    mavlink.MAVLINK_MSG_ID_LOG_REQUEST_LIST,
    mavlink.MAVLINK_MSG_ID_LOG_REQUEST_DATA,
    mavlink.MAVLINK_MSG_ID_LOG_ERASE,
    mavlink.MAVLINK_MSG_ID_LOG_REQUEST_END,
)


Reply = Callable[[Any], None]


class LogFile(NamedTuple):
    """One log."""

    name: str
    size: int
    """Bytes, now"""
    time_utc: int
    """s since 1970, of its last change"""


class LogStore(Protocol):
    """Where the logs are."""

    def list(self) -> list[LogFile]:
        """What there is, in a fixed order."""

    def read(self, name: str, offset: int, size: int) -> bytes:
        """A part of a log that `list` has named; less at its end, nothing if it is gone."""


class NoLogs:
    """No flight is recorded."""

    def list(self) -> list[LogFile]:
        """Nothing."""
        return []

    def read(self, name: str, offset: int, size: int) -> bytes:
        """Nothing."""
        return b""


class _Download(NamedTuple):
    number: int
    name: str
    offset: int
    end: int
    due: float


class LogProtocol:
    """Answers of LOG_*, and what is left to send to each peer."""

    def __init__(self, store: LogStore) -> None:
        self._store = store
        self._downloads: dict[Address, _Download] = {}
        self._erased: set[str] = set()

    def logs(self) -> list[LogFile]:
        """What clients may see, each of another second: they name their copies by it."""
        found: list[LogFile] = []
        times: set[int] = set()
        for log in self._store.list():
            if log.name not in self._erased:
                time = log.time_utc
                while time in times:
                    time += 1
                times.add(time)
                found.append(log._replace(time_utc=time))
        return found

    def read(self, name: str, offset: int, size: int) -> bytes:
        """A part of a log."""
        return self._store.read(name, offset, size)

    def receive(
        self, message: Any, peer: Address, now: float, reply: Reply, say: Callable[[str], None]
    ) -> None:
        """A request; the answer's first part at once."""
        number = message.get_msgId()
        if number == mavlink.MAVLINK_MSG_ID_LOG_REQUEST_LIST:
            self._list(message, reply)
        elif number == mavlink.MAVLINK_MSG_ID_LOG_REQUEST_DATA:
            self._data(message, peer, now, reply)
        elif number == mavlink.MAVLINK_MSG_ID_LOG_ERASE:
            self._erased |= {log.name for log in self._store.list()}
            say("Logs removed from the list; their files are kept")
        else:
            self._downloads.pop(peer, None)

    def _list(self, message: Any, reply: Reply) -> None:
        logs = self.logs()
        entry = mavlink.MAVLink_log_entry_message
        if not logs:
            reply(entry(0, 0, 0, 0, 0))
        for number, log in enumerate(logs):
            if message.start <= number <= message.end:
                reply(entry(number, len(logs), len(logs) - 1, log.time_utc, min(log.size, 0xFFFFFFFF)))

    def _data(self, message: Any, peer: Address, now: float, reply: Reply) -> None:
        logs = self.logs()
        if message.id >= len(logs):
            reply(mavlink.MAVLink_log_data_message(message.id, message.ofs, 0, [0] * CHUNK))
            return
        log = logs[message.id]
        end = min(message.ofs + message.count, log.size)
        self._downloads[peer] = _Download(message.id, log.name, message.ofs, end, now)

    def to_send(self, known: Callable[[Address], bool], now: float) -> list[tuple[Address, Any]]:
        """LOG_DATA that is due."""
        out: list[tuple[Address, Any]] = []
        for peer, download in list(self._downloads.items()):
            if not known(peer):
                del self._downloads[peer]
            elif now >= download.due:
                out += [(peer, message) for message in self._next(peer, download, now)]
        return out

    def _next(self, peer: Address, download: _Download, now: float) -> list[Any]:
        number, name, offset, end, _ = download
        data = self._store.read(name, offset, max(0, min(AT_ONCE * CHUNK, end - offset)))
        messages = []
        for start in range(0, max(len(data), 1), CHUNK):
            part = data[start : start + CHUNK]
            content = list(part.ljust(CHUNK, b"\0"))
            messages.append(mavlink.MAVLink_log_data_message(number, offset + start, len(part), content))
        if not data or offset + len(data) >= end:
            del self._downloads[peer]
        else:
            self._downloads[peer] = _Download(number, name, offset + len(data), end, now + PAUSE)
        return messages

    def next_deadline(self) -> float:
        """When something of a log is due; inf if nothing is."""
        return min((download.due for download in self._downloads.values()), default=math.inf)
