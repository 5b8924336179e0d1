"""What is wrong in a description, a line for each fault: key, value, unit, allowed range, likely meaning."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple, get_args

import annotated_types
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from sitl_bridge.vehicle.physics import PhysicsError, PhysicsFault
from sitl_bridge.vehicle.schema import Vector

# Where pydantic's words are those of Python and not of TOML.
_PROBLEMS = {
    "literal_error": "no such value",
    "tuple_type": "not a list",
    "model_type": "not a table",
    "model_attributes_type": "not a table",
    "too_short": "too few",
    "too_long": "too many",
}
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
Location = tuple[int | str, ...]


class DescriptionError(ValueError):
    """A faulty description; `faults` has one line for each fault."""

    def __init__(self, source: str, faults: Iterable[str]) -> None:
        self.source = " ".join(source.splitlines())
        self.faults = [" ".join(fault.splitlines()) for fault in faults]
        super().__init__("\n".join(f"{self.source}: {fault}" for fault in self.faults))

    @classmethod
    def joined(cls, errors: Sequence[DescriptionError]) -> DescriptionError:
        """One error with the lines of several, each under its own source."""
        error = cls(errors[0].source, [fault for each in errors for fault in each.faults])
        error.args = ("\n".join(str(each) for each in errors),)
        return error


class _Place(NamedTuple):
    """Where a fault is."""

    keys: Location
    """As a person writes them: without the tags of a union."""
    field: FieldInfo | None
    """The deepest declared one on the way."""
    table: type[BaseModel] | None
    """The table that the last key belongs to."""


def fault_lines(model: type[BaseModel], errors: Sequence[Any]) -> list[PhysicsFault]:
    """A fault with its key for each of pydantic's errors."""
    # A list that seems short only because one of its entries is at fault is no fault of its own.
    followed = {error["loc"][:depth] for error in errors for depth in range(1, len(error["loc"]))}
    found: list[PhysicsFault] = []
    meant: set[Location] = set()
    for error in errors:
        place = _place(model, error["loc"])
        if error["type"] == "too_short" and error["loc"] in followed:
            continue
        if error["type"] == "extra_forbidden" and place.table is not None:
            guess = _close(str(place.keys[-1]), place.table.model_fields)
            meant |= {(*place.keys[:-1], guess)} if guess else set()
            found.append(PhysicsFault(place.keys, _unknown(model, place, guess, error["input"])))
        elif isinstance(physics := error.get("ctx", {}).get("error"), PhysicsError):
            found += physics.faults
        else:
            tag = (error["ctx"]["discriminator"].strip("'"),) if error["type"].startswith("union_tag") else ()
            found.append(PhysicsFault((*place.keys, *tag), _line(place, error)))
    mistyped = {f"{dotted(keys)}: missing" for keys in meant}
    return [fault for fault in found if not fault.text.startswith(tuple(f"{m};" for m in mistyped))]


def dotted(keys: Iterable[int | str]) -> str:
    """Keys as TOML writes them, joined by dots."""
    return ".".join(
        str(key) if _BARE_KEY.fullmatch(str(key)) else json.dumps(str(key), ensure_ascii=False)
        for key in keys
    )


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """The known word that a mistyped one is closest to, as the end of a message; empty: none is close."""
    guess = _close(word, known)
    return f"; did you mean {guess}?" if guess else ""


def shown(value: Any) -> str:
    """A faulty value as it goes into a message, cut to a readable length."""
    text = repr(list(value) if isinstance(value, tuple) else value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _close(word: str, known: Iterable[str]) -> str | None:
    return next(iter(difflib.get_close_matches(word, list(known), 1)), None)


def _unknown(model: type[BaseModel], place: _Place, guess: str | None, value: Any) -> str:
    """A key that there is not, and what it may stand for: here, or in another table."""
    leaves = list(_leaves(dotted(place.keys), value))
    said = ", ".join(f"{key} = {shown(entry)}" for key, entry in leaves[:4])
    said += f" and {len(leaves) - 4} more" if len(leaves) > 4 else ""
    whole = dotted((*place.keys[:-1], guess)) if guess else _elsewhere(model, str(place.keys[-1]))
    return f"{said}: no such key{'s' if len(leaves) > 1 else ''}{f'; did you mean {whole}?' if whole else ''}"


def _elsewhere(model: type[BaseModel], key: str) -> str:
    """The tables of the model that have such a key, as alternatives."""
    found = [
        f"{name}.{key}"
        for name, field in model.model_fields.items()
        if any(key in table.model_fields for table in tables_of(field.annotation)) and name != key
    ]
    return " or ".join(found) if len(found) <= 3 else ""


def _leaves(where: str, value: Any) -> Iterator[tuple[str, Any]]:
    """The keys of a table and of the tables in it, with their values; a key of its own for what is none."""
    if isinstance(value, dict) and value:
        for key, entry in value.items():
            yield from _leaves(f"{where}.{dotted([key])}", entry)
    else:
        yield where, value


def _line(place: _Place, fault: Any) -> str:
    """One line for one fault: key, value, unit, allowed range."""
    where, field, kind = dotted(place.keys), place.field, fault["type"]
    if kind.startswith("union_tag"):
        return _tag_line(where, fault)
    unit = unit_of(field)
    problem = _PROBLEMS.get(kind, fault["msg"].removeprefix("Value error, "))
    of_list = bool(place.keys) and isinstance(place.keys[-1], int)
    allowed = _expectation(field, entry=of_list)
    if kind == "missing":
        return f"{where}: missing; expected {allowed or 'a value'}{f' in {unit}' if unit else ''}"
    if kind == "value_error":
        return f"{where}: {problem}" if where else problem
    value = f"{where} = {shown(fault['input'])}{f' {unit}' if unit else ''}"
    return (
        f"{value}: {problem[0].lower()}{problem[1:]}{f'; allowed: {allowed}' if allowed else ''}"
        f"{did_you_mean(str(fault['input']), _options(field))}"
    )


def _tag_line(where: str, fault: Any) -> str:
    """A table that says of what kind it is, by a key that is missing or that there is no kind for."""
    context = fault["ctx"]
    key = f"{where}.{context['discriminator'].strip(chr(39))}"
    if "tag" not in context:
        return f"{key}: missing; expected what kind of {where} it is"
    kinds = [kind.strip(" '") for kind in context["expected_tags"].split(",")]
    guess = did_you_mean(str(context["tag"]), kinds)
    return f"{key} = {shown(context['tag'])}: no such kind; allowed: {' or '.join(kinds)}{guess}"


def _place(model: type[BaseModel], location: Location) -> _Place:
    """Follow a fault's location, which names the member of a union by its tag."""
    keys: list[int | str] = []
    field: FieldInfo | None = None
    union: FieldInfo | None = None
    owner: type[BaseModel] | None = None
    table: type[BaseModel] | None = model
    for part in location:
        if union is not None and isinstance(part, str):
            table, union = _member(union, part), None
            continue
        keys.append(part)
        if isinstance(part, int):
            continue
        owner, field = table, None if table is None else table.model_fields.get(part)
        union = field if field is not None and field.discriminator is not None else None
        table = None if field is None or union is not None else next(tables_of(field.annotation), None)
    return _Place(tuple(keys), field, owner)


def tables_of(annotation: Any) -> Iterator[type[BaseModel]]:
    """The tables that a field can be, or be a list of."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from tables_of(part)


def _member(union: FieldInfo, tag: str) -> type[BaseModel] | None:
    """The table of a union whose discriminator has this value."""
    key = str(union.discriminator)
    of_tag = (t for t in tables_of(union.annotation) if tag in get_args(t.model_fields[key].annotation))
    return next(of_tag, None)


def _options(field: FieldInfo | None) -> list[str]:
    """The words or whole numbers that a field can be; empty: others, too."""
    options = get_args(field.annotation) if field else ()
    return [str(option) for option in options if isinstance(option, (str, int))]


def comment_of(model: type[BaseModel], key: str) -> str:
    """A key of a table in a comment: its unit, what it is, and its range."""
    field = model.model_fields[key]
    unit, allowed = unit_of(field), _expectation(field)
    what = ", ".join(part for part in (unit, field.description or "") if part)
    # A range that is the same on both sides of 0 only keeps nonsense out.
    ranged = "" if ">= -" in allowed or not any(sign in allowed for sign in "<>") else f" ({allowed})"
    return what + ranged


def unit_of(field: FieldInfo | None) -> str:
    """The unit of a declared field; empty: it has none."""
    extra = field.json_schema_extra if field else None
    unit = extra.get("unit", "") if isinstance(extra, dict) else ""
    return "" if unit in ("-", "") else str(unit)


def _expectation(field: FieldInfo | None, entry: bool = False) -> str:
    """The allowed range of a field, or of one entry of it, in words, from its own declaration."""
    if field is None:
        return ""
    if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
        return "a table"
    if options := _options(field):
        return " or ".join(options)
    # A tuple of bounded numbers carries its bounds inside.
    metadata = [*field.metadata, *_marks(field.annotation)]
    lengths = [
        getattr(m, name) for m in metadata for name in ("min_length", "max_length") if hasattr(m, name)
    ]
    tables = next(tables_of(field.annotation), None) is not None
    if len(lengths) == 2 and (tables or not entry):
        return "a table" if entry else "{} to {} {}".format(*lengths, "tables" if tables else "entries")
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
    if not words and Vector in (field.annotation, *get_args(field.annotation)):
        return "a finite number" if entry else "three finite numbers"
    if field.annotation is str:
        return "text"
    return " and ".join(words)


def _marks(annotation: Any) -> Iterator[Any]:
    """The bounds in an annotation, at any depth."""
    for info in getattr(annotation, "__metadata__", ()):
        yield from getattr(info, "metadata", [])
    for part in get_args(annotation):
        yield from _marks(part)
