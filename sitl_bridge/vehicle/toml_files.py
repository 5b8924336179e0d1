"""TOML files that people write: their text, their content, and what is wrong with them in words."""

from __future__ import annotations

import io
import tomllib
from functools import lru_cache
from typing import IO, Any, Protocol

LARGEST = 1_000_000
"""Bytes. Above it, it is another file; /dev/zero has no end."""


class TomlError(ValueError):
    """The file is not TOML; the message says why."""


class _File(Protocol):
    """A path, or a resource of a package."""

    def open(self, mode: str) -> IO[Any]: ...


def toml_text(file: Any) -> str:
    """Return the text of a file: a path, or a resource of a package. A byte order mark is left out.

    Raises OSError; TomlError where it is not UTF-8 or too large; ValueError for an impossible path.
    """
    opened: _File = file
    with opened.open("rb") as source:
        data: bytes = source.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise TomlError(f"not valid TOML: larger than {LARGEST / 1e6:g} MB")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise TomlError(f"not valid TOML: not UTF-8 text (byte {error.start + 1})") from None
    return io.StringIO(text, newline=None).read()


@lru_cache(maxsize=64)
def toml_content(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text; the same object each time, for callers that do not change it.

    A study reads the same few files for each of its flights. Raises TomlError.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise TomlError(f"not valid TOML: {error}") from None
    except RecursionError:
        raise TomlError("not valid TOML: nested too deeply") from None


def what_is_wrong(error: OSError | ValueError) -> str:
    """Return what to say of a file for which `toml_text` or `toml_content` raised."""
    if isinstance(error, TomlError):
        return str(error)
    return f"cannot be read: {getattr(error, 'strerror', None) or error}"
