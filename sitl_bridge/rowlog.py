"""Parquet files of numbers, written in the background in chunks, so that a tick never waits for a disk."""

from __future__ import annotations

import queue
import threading
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class RowLog:
    """Takes chunks of rows. Values are exact doubles but for columns in single precision.

    The same chunks give the same bytes.
    """

    def __init__(self, path: Path, names: Sequence[str], single: Collection[str] = ()) -> None:
        """names: of the columns; single: of those among them that are kept in single precision."""
        self.path = path
        self._types = {name: np.float32 if name in single else np.float64 for name in names}
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
        try:
            import pyarrow as pa
            import pyarrow.parquet as pq

            schema = pa.schema([(name, pa.from_numpy_dtype(kind)) for name, kind in self._types.items()])
            # Doubles split into streams of bytes: those of sign and exponent hardly change.
            options = {"compression": "zstd", "use_dictionary": False, "use_byte_stream_split": True}
            with pq.ParquetWriter(self.path, schema, **options) as writer:
                while (chunk := self._chunks.get()) is not None:
                    columns = zip(chunk.T, self._types.values(), strict=True)
                    arrays: list[Any] = [pa.array(np.ascontiguousarray(c, kind)) for c, kind in columns]
                    writer.write_table(pa.table(arrays, schema=schema))
        except Exception as error:  # handed to the main thread by `close`
            self._failure = error
            while self._chunks.get() is not None:
                pass
