"""Logs that another process makes Parquet files of: the same bytes, and the same failures."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from sitl_bridge import rowlog
from sitl_bridge.parquet import Writer
from sitl_bridge.rowlog import RowLog

CHUNKS = [np.random.default_rng(rows).standard_normal((rows, 3)) for rows in (5, 4096, 1, 300)]


@pytest.fixture
def apart(monkeypatch: pytest.MonkeyPatch) -> Iterator[Writer]:
    """The process, of which nothing may be left."""
    writer = Writer()
    monkeypatch.setattr(rowlog, "_apart", writer)
    yield writer
    assert writer._process is None


def write(path: Path, chunks: list[np.ndarray]) -> bytes:
    log = RowLog(path, ["time_s", "x", "y"], {"y"})
    for chunk in chunks:
        log.write(chunk)
    log.close()
    return path.read_bytes()


@pytest.mark.parametrize("most", [10**9, 50_000, 0])
def test_another_process_writes_the_same_bytes(
    tmp_path: Path, apart: Writer, monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    """All at the end, handed over on the way, or each chunk at once; and files side by side."""
    monkeypatch.setattr(rowlog, "MOST_SPOOLED", most)
    other = RowLog(tmp_path / "other", ["time_s", "x", "y"])
    other.write(CHUNKS[1])
    written = write(tmp_path / "apart", CHUNKS)
    empty = write(tmp_path / "nothing", [])
    other.close()
    monkeypatch.setattr(rowlog, "_apart", None)
    assert written == write(tmp_path / "here", CHUNKS)
    assert empty == write(tmp_path / "nothing here", [])
    assert sorted(os.listdir(tmp_path)) == ["apart", "here", "nothing", "nothing here", "other"]


def test_what_cannot_be_written_is_said_and_disturbs_no_other(tmp_path: Path, apart: Writer) -> None:
    (tmp_path / "folder").mkdir()
    bad, good = (RowLog(tmp_path / name, ["time_s", "x", "y"]) for name in ("folder", "good"))
    for log in (bad, good):
        log.write(CHUNKS[0])
    with pytest.raises(OSError, match="folder"):
        bad.close()
    good.close()
    assert (tmp_path / "good").read_bytes().endswith(b"PAR1")


def test_a_folder_that_is_gone_is_said(tmp_path: Path, apart: Writer) -> None:
    log = RowLog(tmp_path / "gone" / "rows", ["time_s", "x", "y"])
    log.write(CHUNKS[0])
    with pytest.raises(OSError, match="gone"):
        log.close()


def test_a_writer_that_is_killed_is_said(tmp_path: Path, apart: Writer) -> None:
    file = apart.file(tmp_path / "rows", {"time_s": False, "x": False, "y": False})
    assert apart._process is not None
    apart._process.kill()
    file.write(CHUNKS[1])
    with pytest.raises(OSError, match="has ended"):
        file.close()
