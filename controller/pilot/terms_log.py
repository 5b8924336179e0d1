"""The log of what the law's commands were made of: a Parquet file with a row for one tick in so many.

Values are in single precision, but for time. Time is that of the plant's state log: 0 at the first armed
tick. There is no file if no law has told its terms.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from controller.law.terms import TERM_COLUMNS
from sitl_bridge.frames import MICROSECONDS_PER_SECOND
from sitl_bridge.log_amount import Logs
from sitl_bridge.rowlog import RowLog

if TYPE_CHECKING:
    from controller.law.state import Array

FILE_NAME = "law_terms.parquet"
COLUMNS = ("time_s", *TERM_COLUMNS)
EVERY: dict[Logs, int] = {"usual": 5, "all": 1}
"""Ticks between two rows."""
CHUNK_ROWS = 4000


class Termed(Protocol):
    """Who flies a law."""

    @property
    def terms(self) -> Array | None:
        """Terms (20,) of the last command, as TERM_COLUMNS; None: no law flew, or it tells none."""


class TermsLog:
    """Collects rows."""

    def __init__(self, folder: Path, logs: Logs = "all") -> None:
        """logs: how much is kept, see `EVERY`."""
        self._file = folder / FILE_NAME
        self._every = EVERY[logs]
        self._log: RowLog | None = None
        self._rows = np.zeros((CHUNK_ROWS, len(COLUMNS)))
        self._count = 0
        self.restart()

    def restart(self) -> None:
        """The plant has started again: time begins with the next armed tick."""
        self._first_usec: int | None = None
        self._left = 1

    def tick(self, time_usec: int, pilot: Termed) -> None:
        """An armed tick was answered; keep its terms, if it is one that is kept."""
        self._left -= 1
        if self._left:
            return
        self._left = self._every
        if self._first_usec is None:
            self._first_usec = time_usec
        terms = pilot.terms
        if terms is None:
            return
        row = self._rows[self._count]
        row[0] = (time_usec - self._first_usec) / MICROSECONDS_PER_SECOND
        row[1:] = terms
        self._count += 1
        if self._count == CHUNK_ROWS:
            self._flush()

    def close(self) -> None:
        """Write out everything; raises what went wrong while writing."""
        self._flush()
        if self._log is not None:
            self._log.close()

    def _flush(self) -> None:
        if self._count and self._log is None:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            self._log = RowLog(self._file, COLUMNS, TERM_COLUMNS)
        if self._log is not None:
            self._log.write(self._rows[: self._count].copy())
        self._count = 0
