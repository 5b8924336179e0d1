"""Parquet files of numbers, written in the background in chunks, so that a tick never waits for a disk.

A process that has to stay small (`write_apart`) keeps rows as they are in a file without a name, and has
another process make Parquet of them: at the end, or in time before that file gets large.
"""

from __future__ import annotations

import queue
import tempfile
import threading
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import IO

import numpy as np

from sitl_bridge.parquet import Array, HereFile, ParquetFile, Writer

MOST_SPOOLED = 64_000_000
"""Bytes of rows that wait for the end of a flight: some 15 minutes."""

_apart: Writer | None = None


def write_apart() -> None:
    """From now on leave Parquet to a process of its own: a plant or a controller does without Arrow."""
    global _apart
    _apart = Writer()


class RowLog:
    """Takes chunks of rows. Values are exact doubles but for columns in single precision.

    The same chunks give the same bytes.
    """

    def __init__(self, path: Path, names: Sequence[str], single: Collection[str] = ()) -> None:
        """names: of the columns; single: of those among them that are kept in single precision."""
        self.path = path
        self._columns = {name: name in single for name in names}
        self._chunks: queue.SimpleQueue[Array | None] = queue.SimpleQueue()
        self._failure: Exception | None = None
        self._writer = threading.Thread(target=self._write_chunks, name=path.name, daemon=True)
        self._writer.start()

    def write(self, chunk: Array) -> None:
        """Write rows (n, columns), which nobody changes any more."""
        self._chunks.put(chunk)

    def close(self) -> None:
        """Write out everything; raises what went wrong while writing."""
        self._chunks.put(None)
        self._writer.join()
        if self._failure is not None:
            raise self._failure

    def _write_chunks(self) -> None:
        closed = False
        try:
            file = _opened(self.path, self._columns)
            try:
                while (chunk := self._chunks.get()) is not None:
                    file.write(chunk)
                closed = True
            finally:
                file.close()
        except Exception as error:  # handed to the main thread by `close`
            self._failure = error
            while not closed and self._chunks.get() is not None:
                pass


def _opened(path: Path, columns: dict[str, bool]) -> ParquetFile:
    return HereFile(path, columns) if _apart is None else _Spooled(_apart, path, columns)


class _Spooled:
    """Chunks wait in a file without a name, which nothing is left of even if this process is killed."""

    def __init__(self, writer: Writer, path: Path, columns: dict[str, bool]) -> None:
        self._writer, self._path, self._columns = writer, path, columns
        # Open for as long as the log is.
        self._spool: IO[bytes] | None = tempfile.TemporaryFile(dir=path.parent)  # noqa: SIM115
        self._lengths: list[int] = []
        self._file: ParquetFile | None = None

    def write(self, chunk: Array) -> None:
        if self._file is not None:
            self._file.write(chunk)
            return
        assert self._spool is not None
        self._spool.write(np.ascontiguousarray(chunk).tobytes())
        self._lengths.append(len(chunk))
        if self._spool.tell() > MOST_SPOOLED:
            self._hand_over()

    def close(self) -> None:
        self._hand_over().close()

    def _hand_over(self) -> ParquetFile:
        if self._file is None:
            assert self._spool is not None
            self._file = self._writer.file(self._path, self._columns)
            self._spool.seek(0)
            width = len(self._columns)
            for length in self._lengths:
                content = self._spool.read(8 * length * width)
                self._file.write(np.frombuffer(content).reshape(length, width))
            self._spool.close()
            self._spool = None
        return self._file
