"""The flight's folder as a store of logs: regular files in it, of the kinds that a flight leaves."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from controller.ground.files.logs import LogFile

KINDS = (".parquet", ".tlog", ".ulg", ".mcap", ".json", ".jsonl", ".html", ".csv", ".mat", ".png")


class LogFolder:
    """Reads when asked; a file that is gone, or that is none, has nothing in it."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def list(self) -> list[LogFile]:
        """By name, so that a log keeps its number."""
        found = []
        try:
            entries = list(os.scandir(self._folder))
        except OSError:
            return []
        for entry in entries:
            try:
                status = entry.stat(follow_symlinks=False)
            except OSError:
                continue
            named = entry.name.endswith(KINDS) and entry.name.isascii()
            if named and stat.S_ISREG(status.st_mode) and status.st_size:
                found.append(LogFile(entry.name, status.st_size, int(status.st_mtime)))
        return sorted(found)

    def read(self, name: str, offset: int, size: int) -> bytes:
        """A part of a file that `list` has named."""
        if "/" in name or not name.endswith(KINDS):
            return b""
        try:
            descriptor = os.open(self._folder / name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        except OSError:
            return b""
        try:
            regular = stat.S_ISREG(os.fstat(descriptor).st_mode)
            return os.pread(descriptor, size, offset) if regular else b""
        except (OSError, OverflowError):
            return b""
        finally:
            os.close(descriptor)
