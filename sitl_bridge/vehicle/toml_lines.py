"""In which line of a TOML text a key is, for messages: `tomllib` does not tell. Pure functions."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from typing import Any

Location = tuple[int | str, ...]


def line_of(text: str, location: Location) -> int | None:
    """The line, from 1, of a key in valid TOML, or of the innermost table that it would be in; None: neither.

    location: keys, and indices (from 0) of lists.
    """
    lines = key_lines(text)
    for length in range(len(location), 0, -1):
        if location[:length] in lines:
            return lines[location[:length]]
    return None


def key_lines(text: str) -> dict[Location, int]:
    """The line, from 1, in which each key and table of valid TOML begins."""
    found: dict[Location, int] = {}
    table: Location = ()
    entries: dict[Location, int] = {}  # of arrays of tables, so far
    for number, content, is_header in _statements(text):
        if not is_header:
            for path in _paths(content):
                found.setdefault((*table, *path), number)
            continue
        table = ()
        (path,) = _header(content)
        for depth, key in enumerate(path, start=1):
            table = (*table, key)
            if depth == len(path) and _is_array(content):
                entries[table] = entries.get(table, 0) + 1
            found.setdefault(table, number)
            if table in entries:
                table = (*table, entries[table] - 1)
                found.setdefault(table, number)
    return found


def _statements(text: str) -> Iterator[tuple[int, dict[str, Any], bool]]:
    """Line, content on its own, and whether it is a table's header, of each statement."""
    begun, first = "", 1
    for number, line in enumerate(text.split("\n"), start=1):
        first = first if begun else number
        begun += line + "\n"
        try:
            content = tomllib.loads(begun)
        except tomllib.TOMLDecodeError:
            continue  # a value of several lines
        if content:
            yield first, content, begun.lstrip().startswith("[")
        begun = ""


def _paths(content: Any, above: Location = ()) -> Iterator[Location]:
    """Keys and indices on the way to each value, and to each table and list on the way."""
    pairs: Any = content.items() if isinstance(content, dict) else enumerate(content)
    for key, value in pairs:
        yield (*above, key)
        if isinstance(value, (dict, list)):
            yield from _paths(value, (*above, key))


def _header(content: Any, above: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The keys of `[a.b]` or `[[a.b]]`, from its content on its own."""
    for key, value in content.items():
        inner = value[0] if isinstance(value, list) else value
        yield from _header(inner, (*above, key)) if inner else ((*above, key),)


def _is_array(content: Any) -> bool:
    """Whether a header is that of an array of tables."""
    value = next(iter(content.values()))
    return isinstance(value, list) or (bool(value) and _is_array(value))
