"""What is wrong with a value in a description, in one line: key, value, unit, allowed range."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import annotated_types
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from sitl_bridge.vehicle.schema import Vector

# Where pydantic's words are those of Python and not of TOML.
_PROBLEMS = {
    "tuple_type": "not a list",
    "model_type": "not a table",
    "too_short": "too few",
    "too_long": "too many",
}


def _shown(value: Any) -> str:
    """A faulty value as it goes into a message, cut to a readable length."""
    text = repr(list(value) if isinstance(value, tuple) else value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _leaves(where: str, value: Any) -> Iterator[tuple[str, Any]]:
    """The keys of a table and of the tables in it, with their values; a key of its own for what is none."""
    if isinstance(value, dict) and value:
        for key, entry in value.items():
            yield from _leaves(f"{where}.{key}", entry)
    else:
        yield where, value


def fault_line(model: type[BaseModel], fault: Any) -> str:
    """One line for one fault: key, value, unit, allowed range."""
    where = ".".join(str(part) for part in fault["loc"])
    field = _field_at(model, fault["loc"])
    unit = _unit(field)
    problem = _PROBLEMS.get(fault["type"], fault["msg"].removeprefix("Value error, "))
    if fault["type"] == "missing":
        return f"{where}: missing; expected {_expectation(field) or 'a value'}{f' in {unit}' if unit else ''}"
    if fault["type"] == "extra_forbidden":
        return "; ".join(
            f"{key} = {_shown(value)}: no such key" for key, value in _leaves(where, fault["input"])
        )
    if fault["type"] == "value_error":
        return f"{where}: {problem}" if where else problem
    of_list = isinstance(fault["loc"][-1], int)
    allowed = _expectation(field, entry=of_list)
    value = f"{where} = {_shown(fault['input'])}{f' {unit}' if unit else ''}"
    return f"{value}: {problem[0].lower()}{problem[1:]}{f'; allowed: {allowed}' if allowed else ''}"


def _field_at(model: Any, location: tuple[int | str, ...]) -> FieldInfo | None:
    """The deepest declared field on the way to a fault."""
    field: FieldInfo | None = None
    for part in location:
        if isinstance(part, int) or not (isinstance(model, type) and issubclass(model, BaseModel)):
            continue
        field = model.model_fields.get(str(part))
        if field is None:
            return None
        candidates = [field.annotation, *getattr(field.annotation, "__args__", ())]
        model = next((c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel)), None)
    return field


def _unit(field: FieldInfo | None) -> str:
    extra = field.json_schema_extra if field else None
    unit = extra.get("unit", "") if isinstance(extra, dict) else ""
    return "" if unit in ("-", "") else str(unit)


def _expectation(field: FieldInfo | None, entry: bool = False) -> str:
    """The allowed range of a field, or of one entry of it, in words, from its own declaration."""
    if field is None:
        return ""
    if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
        return "a table"
    options = getattr(field.annotation, "__args__", ())
    if options and all(isinstance(option, str) for option in options):
        return " or ".join(options)
    metadata = list(field.metadata)
    for argument in options:  # a tuple of bounded numbers carries its bounds inside
        metadata += [
            m for info in getattr(argument, "__metadata__", ()) for m in getattr(info, "metadata", [])
        ]
    lengths = [
        getattr(m, name) for m in metadata for name in ("min_length", "max_length") if hasattr(m, name)
    ]
    if len(lengths) == 2:
        return "a table" if entry else "{} to {} tables".format(*lengths)
    words: dict[str, None] = {}
    for mark in metadata:
        for kind, name, sign in (
            (annotated_types.Gt, "gt", ">"),
            (annotated_types.Ge, "ge", ">="),
            (annotated_types.Lt, "lt", "<"),
            (annotated_types.Le, "le", "<="),
        ):
            if isinstance(mark, kind):
                words[f"{sign} {getattr(mark, name):g}"] = None
    if not words and Vector in (field.annotation, *options):
        return "a finite number" if entry else "three finite numbers"
    if field.annotation is str:
        return "text"
    return " and ".join(words)
