"""Parameters in a file: JSON, one object of names and numbers, written in one step."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path


class ParameterFile:
    """Where parameters are kept between two runs."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def load(self) -> tuple[dict[str, object], str]:
        """The values, and what is wrong with the file (empty if nothing, also if there is none yet).

        A file that cannot be read as what it should be is put aside, so that the next save does not lose it.
        A folder or a device stays where it is. A byte order mark is left out.
        """
        try:
            values = json.loads(self._path.read_text(encoding="utf-8-sig"))
            if isinstance(values, dict):
                return values, ""
            fault = "not a table of names and numbers"
        except FileNotFoundError:
            return {}, ""
        except (OSError, ValueError, RecursionError) as error:
            fault = str(error)
        aside = self._path.with_name(self._path.name + ".corrupt")
        if self._path.exists() and not self._path.is_file():
            return {}, f"{self._path.name}: no file; defaults used"
        try:
            os.replace(self._path, aside)
        except OSError:
            return {}, f"{self._path.name}: {fault}; defaults used"
        return {}, f"{self._path.name}: {fault}; defaults used, file kept as {aside.name}"

    def save(self, values: Mapping[str, float]) -> str:
        """Write all values; returns what went wrong, or an empty string.

        A link is followed. What is no file, /dev/null for one, is not replaced by one.
        """
        try:
            path = self._path.resolve()
            if path.exists() and not path.is_file():
                return f"{self._path.name}: no file; values are not kept"
            draft = path.with_name(path.name + ".new")
            draft.write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")
            os.replace(draft, path)
        except OSError as error:
            return f"{self._path.name}: {error.strerror}"
        return ""
