"""How both processes are asked to stop, and how they speak to the person or program that started them."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from typing import Any


class StopRequest:
    """Set by SIGINT, SIGTERM or SIGHUP (also where a shell had them ignored), or when standard input ends."""

    def __init__(self) -> None:
        self.reason: str | None = None

    def __bool__(self) -> bool:
        return self.reason is not None

    def install(self, watch_stdin: bool = False) -> None:
        """Take over the signals; with watch_stdin, stop too when whoever holds our standard input is gone."""
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._on_signal)
        if watch_stdin:
            threading.Thread(target=self._watch_stdin, name="stdin", daemon=True).start()

    def _on_signal(self, number: int, frame: Any) -> None:
        self.reason = signal.Signals(number).name

    def _watch_stdin(self) -> None:
        while os.read(sys.stdin.fileno(), 4096):
            pass
        self.reason = "end of standard input"


class Speaker:
    """Messages for people go to standard error; events for programs, when asked for, to standard output."""

    def __init__(self, name: str, events: bool) -> None:
        self._name = name
        self._events = events

    def say(self, text: str) -> None:
        """One line for a person."""
        print(f"{self._name}: {text}", file=sys.stderr, flush=True)

    def event(self, kind: str, **fields: Any) -> None:
        """One JSON object on a line of its own, for the program that started this one."""
        if self._events:
            print(json.dumps({"event": kind, **fields}), flush=True)
