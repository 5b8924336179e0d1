"""The diary of a flight: `events.jsonl`, a JSON object a line, written by plant and controller alike.

Each line is written whole and at the end of the file, so both processes can share one file.
"""

from __future__ import annotations

import contextlib
import json
import math
from pathlib import Path
from typing import Literal, NamedTuple

FILE_NAME = "events.jsonl"

Kind = Literal["message", "mode", "fault", "statustext"]
"""A line for a person; a flight mode; a fault that begins or ends; a STATUSTEXT to ground stations."""


class Event(NamedTuple):
    """Something that happened."""

    time_s: float | None
    """Scenario time; None: before the scenario began."""
    source: str
    """`plant` or `controller`."""
    kind: Kind
    text: str


class EventLog:
    """Appends events to a flight's diary. They are few: the file is opened for each."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._file = folder / FILE_NAME

    def add(self, event: Event) -> None:
        """Append one event; one that cannot be written is lost, and the flight goes on."""
        line = json.dumps(event._asdict()) + "\n"
        with contextlib.suppress(OSError), self._file.open("ab", buffering=0) as file:
            file.write(line.encode())


def read_events(folder: Path) -> list[Event]:
    """The diary in order of time, what came before the scenario first; empty where there is none.

    A line that is none of ours is left out: the last one may be cut short by a kill.
    """
    try:
        lines = (folder / FILE_NAME).read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
    found = [event for line in lines if (event := _event(line)) is not None]
    return sorted(found, key=lambda event: -math.inf if event.time_s is None else event.time_s)


def _event(line: str) -> Event | None:
    try:
        fields = json.loads(line)
        time_s = fields["time_s"]
        return Event(
            None if time_s is None else float(time_s),
            str(fields["source"]),
            fields["kind"],
            str(fields["text"]),
        )
    except (ValueError, TypeError, KeyError):
        return None
