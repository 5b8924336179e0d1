"""Vehicle and scenario files: a section for each table, a row for each key, with unit and range."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from sitl.flights.scenario import Scenario
from sitl.reference_pages.tables import page, table
from sitl_bridge.vehicle.description import Vehicle

HEADINGS = ("key", "unit", "range", "default", "meaning")


def vehicle_markdown() -> str:
    """The page about vehicle files."""
    return _markdown("Vehicle files", "`sitl_bridge/vehicle/description.py`", Vehicle)


def scenario_markdown() -> str:
    """The page about scenario files."""
    return _markdown("Scenario files", "`sitl/flights/scenario.py`", Scenario)


def _markdown(title: str, source: str, model: type[BaseModel]) -> str:
    schema = model.model_json_schema()
    definitions: dict[str, Any] = schema.get("$defs", {})
    about = [
        "TOML. Units are SI, the world is ENU with z up, the body FLU, angles are in radians.",
        "A key without a default has to be given. `--set KEY=VALUE` changes one value of a vehicle, as in",
        "`--set cable.rest_length=10`.",
    ]
    return page(title, source, about, *_sections("", schema, definitions))


def _sections(path: str, schema: dict[str, Any], definitions: dict[str, Any]) -> Iterator[list[str]]:
    """The table of a schema, then those of the tables in it, depth first."""
    rows, inner = [], []
    for key, field in schema["properties"].items():
        below = [(name, definitions[name]) for name in _references(field)]
        if not below:
            required = key in schema.get("required", ())
            rows.append((f"`{key}`", *_cells(field, required)))
        for name, definition in below:
            several = "array" in (field.get("type"), *(part.get("type") for part in field.get("anyOf", ())))
            heading = f"[[{path}{key}]]" if several else f"[{path}{key}]"
            if len(below) > 1:
                kind = definition["properties"].get("kind", {}).get("const", name)
                heading = f'{heading} kind = "{kind}"'
            inner.append((heading, f"{path}{key}.", definition))
    if rows:
        yield table(HEADINGS, rows)
    for heading, deeper, definition in inner:
        about = definition.get("description", "").split("\n\n")[0].replace("\n", " ")
        yield [f"## `{heading}`", *(["", about] if about else [])]
        yield from _sections(deeper, definition, definitions)


def _references(field: dict[str, Any]) -> list[str]:
    """Names of the tables that a field holds."""
    found = []
    for part in (field, field.get("items", {}), *field.get("anyOf", ()), *field.get("oneOf", ())):
        for reference in (part, part.get("items", {})):
            if "$ref" in reference:
                found.append(reference["$ref"].rpartition("/")[2])
    return list(dict.fromkeys(found))


def _cells(field: dict[str, Any], required: bool) -> tuple[str, str, str, str]:
    unit = field.get("unit", "")
    default = "" if required else _value(field.get("default"))
    return ("" if unit == "-" else unit, _range(field), default, field.get("description", ""))


def _range(field: dict[str, Any]) -> str:
    parts = [part for part in field.get("anyOf", (field,)) if part.get("type") != "null"]
    part = {**field, **parts[0]} if parts else field
    if "enum" in part:
        return ", ".join(f"`{value}`" for value in part["enum"])
    if "const" in part:
        return f"`{part['const']}`"
    if part.get("type") == "array":
        elements = part.get("prefixItems") or [part.get("items", {})]
        each = _range(elements[0])
        most = f" of {part.get('minItems', 0)} to {part['maxItems']}" if "maxItems" in part else ""
        count = f"{len(elements)} numbers" if "prefixItems" in part else f"a list{most}"
        return f"{count}, each {each}" if each else count
    low = _bound(part, "exclusiveMinimum", "above ") or _bound(part, "minimum", "from ")
    high = _bound(part, "exclusiveMaximum", "below ") or _bound(part, "maximum", "to ")
    return f"{low} {high}".strip()


def _bound(part: dict[str, Any], key: str, word: str) -> str:
    return f"{word}{part[key]:g}" if key in part else ""


def _value(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, list):
        return f"`[{', '.join(map(_bare, value))}]`"
    return f"`{_bare(value)}`"


def _bare(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
