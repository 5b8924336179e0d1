"""Progress of a flight on a terminal: one live table. Elsewhere: a line now and then."""

from __future__ import annotations

import os
import sys
import threading
import time
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any

from sitl.terminal.status import WIDE, Status, cells, plain_text, what_happened

if TYPE_CHECKING:
    from rich.console import Console
    from rich.live import Live
    from rich.table import Table

LINE_INTERVAL = 5.0
"""s between two lines where there is no terminal."""
NO_LIMIT = 1000
"""Columns of a stream that is no terminal, unless $COLUMNS says how many."""


def live_table(status: Status, width: int) -> Table:
    """The status as a row under its headings; in a narrow terminal, a line for each cell."""
    from rich.table import Table

    shown = cells(status)
    if width >= WIDE:
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        for heading, _ in shown:
            table.add_column(heading, header_style="dim")
        table.add_row(*(text for _, text in shown))
        return table
    table = Table.grid(padding=(0, 1))
    for heading, text in shown:
        table.add_row(heading, text)
    return table


class Display:
    """Shows a status again and again, and lines in between. A context: on leaving, the terminal is as before.

    On a terminal, child processes write their messages to `messages`, so that they stand above the table:
    see `forward`.
    """

    def __init__(self, stream: IO[str] | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._next_line = 0.0
        self._last: Status | None = None
        self._console: Console | None = None
        self._live: Live | None = None
        self._reading: int | None = None
        self._reader: threading.Thread | None = None
        self.messages: int | None = None
        """File descriptor for the standard error of child processes; None: they have ours."""

    def __enter__(self) -> Display:
        if self._stream.isatty() and os.environ.get("TERM", "dumb") not in ("dumb", "unknown"):
            from rich.console import Console

            self._console = Console(file=self._stream, markup=False, highlight=False, emoji=False)
            self._reading, self.messages = os.pipe()
        return self

    def forward(self) -> None:
        """From now on print the messages of child processes, once they are launched.

        Not before: a process with a thread cannot be forked.
        """
        if self._reading is not None:
            self._reader = threading.Thread(target=self._forward, args=(self._reading,), daemon=True)
            self._reading = None
            self._reader.start()

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end()

    def show(self, status: Status) -> None:
        """Show how it goes now."""
        happened = what_happened(self._last, status)
        self._last = status
        if happened is not None:
            self.say(f"fly: {happened}")
        if self._console is not None:
            self._refresh(status)
        elif time.monotonic() >= self._next_line:
            self._next_line = time.monotonic() + LINE_INTERVAL
            self.say(plain_text(status, _columns()))

    def say(self, text: str) -> None:
        """Print lines above the table."""
        if self._console is None:
            print(text, file=self._stream, flush=True)
        else:
            self._console.print(text, soft_wrap=True)

    def end(self) -> None:
        """Leave the table as it stands, once every message of the child processes is out."""
        if self.messages is not None:
            os.close(self.messages)
            self.messages = None
        if self._reading is not None:
            os.close(self._reading)
            self._reading = None
        if self._reader is not None:
            self._reader.join(timeout=1.0)
            self._reader = None
        if self._live is not None:
            self._live.stop()
            self._live = None
        self._console = None

    def _refresh(self, status: Status) -> None:
        assert self._console is not None
        table = live_table(status, self._console.width)
        if self._live is None:
            from rich.live import Live

            options: dict[str, Any] = {"redirect_stdout": False, "redirect_stderr": False}
            self._live = Live(table, console=self._console, auto_refresh=False, **options)
            self._live.start()
        self._live.update(table, refresh=True)

    def _forward(self, reading: int) -> None:
        with open(reading, encoding="utf-8", errors="replace") as lines:
            for line in lines:
                self.say(line.rstrip("\n"))


def _columns() -> int:
    """Columns of a stream that is no terminal."""
    given = os.environ.get("COLUMNS", "")
    return int(given) if given.isdigit() and int(given) > 0 else NO_LIMIT
