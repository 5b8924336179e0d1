"""How both processes are asked to stop, and how they speak to the person or program that started them."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from collections.abc import Callable
from typing import Any, TextIO

from sitl_bridge.event_log import Event, EventLog, Kind

FLIGHT_OVER = b"over\n"
"""What a parent writes to a child's standard input when there is nothing more to do."""


class StopRequest:
    """Set by SIGINT, SIGTERM or SIGHUP (also where a shell had them ignored), or through standard input."""

    def __init__(self) -> None:
        self.reason: str | None = None

    def __bool__(self) -> bool:
        return self.reason is not None

    def install(self, watch_stdin: bool = False) -> None:
        """Take over the signals; with watch_stdin, stop too when our standard input says so, or has ended."""
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._on_signal)
        if watch_stdin:
            threading.Thread(target=self._watch_stdin, name="stdin", daemon=True).start()

    def _on_signal(self, number: int, frame: Any) -> None:
        self.reason = signal.Signals(number).name

    def _watch_stdin(self) -> None:
        said = os.read(sys.stdin.fileno(), len(FLIGHT_OVER))
        self.reason = "the end of the flight" if said == FLIGHT_OVER else "end of standard input"


class Speaker:
    """Messages for people go to standard error; events for programs, when asked for, to standard output."""

    def __init__(self, name: str, events: bool, stream: TextIO | None = None) -> None:
        """stream: for events, by default standard output."""
        self._name = name
        self._events = events
        self._stream = stream
        self._diary: EventLog | None = None
        self._time_s: Callable[[], float | None] = lambda: None

    def keep(self, diary: EventLog, time_s: Callable[[], float | None]) -> None:
        """Enter what is said and noted from now on into a diary; time_s: the scenario's time, s."""
        self._diary, self._time_s = diary, time_s

    def say(self, text: str) -> None:
        """One line for a person."""
        self._show(text)
        self.note("message", text)

    def note(self, kind: Kind, text: str) -> None:
        """An entry in the diary, if one is kept."""
        if self._diary is not None:
            self._diary.add(Event(self._time_s(), self._name, kind, text))

    def _show(self, text: str) -> None:
        print(f"{self._name}: {text}", file=sys.stderr, flush=True)

    def event(self, kind: str, **fields: Any) -> None:
        """One JSON object on a line of its own, for the program that started this one."""
        if self._events:
            print(json.dumps({"event": kind, **fields}), file=self._stream, flush=True)
