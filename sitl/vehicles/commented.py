"""A description as TOML with comments: unit, meaning and range of each key, from its declaration."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.errors import comment_of, tables_of

COLUMN = 34
"""Where comments begin; above the key, where its value does not leave that much room."""
HEAD = """\
Units are SI. The world is east, north, up; the body forward, left, up.
`sitl vehicle check` says what follows from these figures."""


def toml_text(content: dict[str, Any], head: str) -> str:
    """The text of a vehicle's file. head: what its first comment says."""
    lines = [f"# {line}" for line in (*head.splitlines(), *HEAD.splitlines())]
    return "\n".join([*lines, *_table(content, Vehicle, ())]) + "\n"


def _table(
    content: dict[str, Any], model: type[BaseModel], above: tuple[str, ...], terse: bool = False
) -> Iterator[str]:
    """Its plain values first, as TOML wants it, then the tables in it. terse: without comments."""
    tables = {}
    for key, value in content.items():
        if isinstance(value, dict) or (isinstance(value, list) and value and isinstance(value[0], dict)):
            tables[key] = value
            continue
        entry, comment = f"{key} = {_value(value)}", "" if terse else f"# {comment_of(model, key)}"
        if comment and len(entry) < COLUMN:
            yield f"{entry:<{COLUMN}}{comment}"
        else:
            yield from (line for line in (comment, entry) if line)
    for key, value in tables.items():
        inner, path = next(tables_of(model.model_fields[key].annotation)), (*above, key)
        if isinstance(value, dict):
            yield from ("", f"[{'.'.join(path)}]", *_table(value, inner, path))
            continue
        for index, entry in enumerate(value):
            yield from ("", f"[[{'.'.join(path)}]]", *_table(entry, inner, path, terse=index > 0))


def _value(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_value(entry) for entry in value) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
