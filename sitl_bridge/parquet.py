"""A Parquet file of numbers, in this process or in one of its own.

Arrow is some 40 MB of memory and takes a tenth of a second to load. A plant or controller leaves it to a
process that lives while something is written: `python -m sitl_bridge.parquet`. Its standard input has, for
each file by its number, a line of JSON with path and columns; for each chunk a line with the number of rows,
and the rows; and a line that ends the file, which it answers with a line: what went wrong, or null.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Columns = Mapping[str, bool]
"""Names of the columns; whether they are kept in single precision."""


class ParquetFile(Protocol):
    """Takes chunks of rows (n, columns). The same chunks give the same bytes."""

    def write(self, chunk: Array) -> None: ...
    def close(self) -> None: ...


class HereFile:
    """Written by this process."""

    def __init__(self, path: Path, columns: Columns) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        self._types = [np.float32 if single else np.float64 for single in columns.values()]
        types = [pa.float32() if single else pa.float64() for single in columns.values()]
        self._schema = pa.schema(list(zip(columns, types, strict=True)))
        # Doubles split into streams of bytes: those of sign and exponent hardly change.
        options = {"compression": "zstd", "use_dictionary": False, "use_byte_stream_split": True}
        self._writer = pq.ParquetWriter(path, self._schema, **options)

    def write(self, chunk: Array) -> None:
        """Write rows, as one row group."""
        import pyarrow as pa

        columns = zip(chunk.T, self._types, strict=True)
        arrays: list[Any] = [pa.array(np.ascontiguousarray(c, kind)) for c, kind in columns]
        self._writer.write_table(pa.table(arrays, schema=self._schema))

    def close(self) -> None:
        """Write the end, without which it is no Parquet file."""
        self._writer.close()


class Writer:
    """The process of its own, which several threads give files. It ends when no file is open."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._open: set[int] = set()
        self._count = 0

    def file(self, path: Path, columns: Columns) -> ParquetFile:
        """A file that it writes."""
        with self._lock:
            self._count += 1
            number = self._count
            self._open.add(number)
            self._send({"file": number, "path": os.path.abspath(path), "columns": dict(columns)})
        return _FileApart(self, number)

    def rows(self, number: int, chunk: Array) -> None:
        """Rows of one of its files."""
        with self._lock:
            self._send({"file": number, "rows": len(chunk)}, np.ascontiguousarray(chunk, "<f8").tobytes())

    def end(self, number: int) -> None:
        """Finish a file; raises OSError with what went wrong."""
        with self._lock:
            self._send({"file": number, "end": True})
            assert self._process is not None
            assert self._process.stdout is not None
            answer = self._process.stdout.readline()
            self._open.discard(number)
            if not self._open:
                self._stop()
        failure = json.loads(answer) if answer else "the process that writes Parquet files has ended"
        if failure is not None:
            raise OSError(failure)

    def _send(self, what: object, rows: bytes = b"") -> None:
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "sitl_bridge.parquet"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
                start_new_session=True,  # Ctrl-C is not for it: the flight that ends has something to write
            )
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(what).encode() + b"\n" + rows)
            self._process.stdin.flush()
        except BrokenPipeError:  # `end` says so
            pass

    def _stop(self) -> None:
        assert self._process is not None
        self._process.communicate()
        self._process = None


class _FileApart:
    def __init__(self, writer: Writer, number: int) -> None:
        self._writer, self._number = writer, number

    def write(self, chunk: Array) -> None:
        self._writer.rows(self._number, chunk)

    def close(self) -> None:
        self._writer.end(self._number)


def main() -> None:
    """Write what standard input says."""
    files: dict[int, HereFile] = {}
    widths: dict[int, int] = {}
    failures: dict[int, str] = {}
    source = sys.stdin.buffer
    while line := source.readline():
        asked = json.loads(line)
        number = asked["file"]
        try:
            if "path" in asked:
                widths[number] = len(asked["columns"])
                files[number] = HereFile(Path(asked["path"]), asked["columns"])
            elif "rows" in asked:
                shape = asked["rows"], widths[number]
                content = source.read(8 * shape[0] * shape[1])
                if number not in failures:
                    files[number].write(np.frombuffer(content, "<f8").reshape(shape))
            elif number not in failures:
                files[number].close()
        except Exception as error:  # handed on with the end of the file
            failures[number] = f"{type(error).__name__}: {error}"
        if "end" in asked:
            print(json.dumps(failures.get(number)), flush=True)


if __name__ == "__main__":
    main()
