"""The rows of a study: Parquet files in a folder, written as flights end, so that a stop loses nothing."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

FOLDER = "flights"
"""Of the dataset, in the study's output folder."""
IDENTITY = "identity"
TEXTS = ("identity", "outcome", "outcome_cause", "design", "feedback", "vehicle", "versions")


def read_rows(out: Path) -> list[dict[str, Any]]:
    """Every row that is there; files that were not finished are left out."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows: list[dict[str, Any]] = []
    for file in sorted((out / FOLDER).glob("*.parquet")):
        try:
            rows += pq.read_table(file).to_pylist()
        except pa.ArrowInvalid:
            file.unlink()  # written by somebody who was killed meanwhile; its flights are flown again
    return rows


def write_rows(out: Path, rows: Iterable[Mapping[str, Any]]) -> None:
    """Add rows, in a file of their own that appears whole or not at all."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = list(rows)
    if not rows:
        return
    folder = out / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    names = list(dict.fromkeys(name for row in rows for name in row))
    columns = {name: _column(name, [row.get(name) for row in rows]) for name in names}
    number = next(n for n in itertools.count() if not (folder / f"part-{n:05d}.parquet").exists())
    temporary = folder / f".part-{number:05d}.tmp"
    pq.write_table(pa.table(columns), temporary)
    temporary.replace(folder / f"part-{number:05d}.parquet")


def _column(name: str, values: list[Any]) -> Any:
    """Numbers as doubles, everything else as text: so all files have the same types."""
    import pyarrow as pa

    given = [value for value in values if value is not None]
    numeric = name not in TEXTS and all(isinstance(value, (int, float)) for value in given)
    if numeric:
        return pa.array([None if v is None else float(v) for v in values], type=pa.float64())
    return pa.array([None if v is None else _text(v) for v in values], type=pa.string())


def _text(value: Any) -> str:
    return value if isinstance(value, str) else str(list(value) if isinstance(value, tuple) else value)
