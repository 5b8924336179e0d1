"""What went wrong in a law, in one line: which exception, in which file and line."""

from __future__ import annotations

import inspect
import reprlib
import traceback
from pathlib import Path
from typing import Any

LONGEST = 200
"""Characters of an exception's own text that are shown."""


def one_line(value: object) -> str:
    """A short representation of any value, on one line."""
    return _shortened(reprlib.repr(value))


def cause(error: BaseException, source: Any = None, file: str | None = None) -> str:
    """`ZeroDivisionError: division by zero (pid.py, line 33)`.

    The line is the innermost one of the law's own file: `file`, or that of the class or function `source`. If
    that file has no part in it, it is the innermost of all.
    """
    text = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    if isinstance(error, SyntaxError) and error.filename:
        return f"SyntaxError: {error.msg} ({Path(error.filename).name}, line {error.lineno})"
    frames = traceback.extract_tb(error.__traceback__)
    own = file or _file_of(source)
    inside = [frame for frame in frames if frame.filename == own] or frames[-1:]
    place = f" ({Path(inside[-1].filename).name}, line {inside[-1].lineno})" if inside else ""
    return _shortened(text) + place


def place_of(function: Any) -> str:
    """` (pid.py, line 20)`: where a function begins; empty if it has no source."""
    code = getattr(inspect.unwrap(getattr(function, "__func__", function)), "__code__", None)
    return "" if code is None else f" ({Path(code.co_filename).name}, line {code.co_firstlineno})"


def _file_of(source: Any) -> str | None:
    try:
        return None if source is None else inspect.getfile(source)
    except TypeError:
        return None


def _shortened(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= LONGEST else line[: LONGEST - 1] + "…"
