"""The Python interface: signatures and docstrings of what is public."""

from __future__ import annotations

import dataclasses
import inspect
import re
from pathlib import Path
from typing import Any

from sitl import api, testing
from sitl.reference_pages.tables import page, table

PUBLIC: tuple[tuple[str, Any], ...] = (
    ("sitl.fly", api.fly),
    ("sitl.Flight", api.Flight),
    ("sitl.testing.flying_vehicle", testing.flying_vehicle),
    ("sitl.testing.SimulatedVehicle", testing.SimulatedVehicle),
)


def markdown() -> str:
    """The page."""
    fixture = [
        "## The pytest fixture `sitl_vehicle`",
        "",
        "Installed with the package: `def test_mine(sitl_vehicle): …` gets a",
        "`sitl.testing.SimulatedVehicle` on free ports, on the ground and disarmed.",
    ]
    sections = [_section(name, thing) for name, thing in PUBLIC]
    return page("Python interface", "`sitl/api.py` and `sitl/testing.py`", *sections, fixture)


def _section(name: str, thing: Any) -> list[str]:
    lines = [f"## `{name}`", ""]
    if not inspect.isclass(thing):
        lines += ["```python", _signature(name, thing), "```", ""]
    lines += (inspect.getdoc(thing) or "").splitlines()
    if inspect.isclass(thing):
        lines += ["", *table(("attribute", "type", "meaning"), _attributes(thing))]
        for method, function in inspect.getmembers(thing, inspect.isfunction):
            if not method.startswith("_") and function.__doc__:
                lines += ["", f"`{_signature(method, function)}`: {inspect.getdoc(function)}"]
    return lines


def _signature(name: str, function: Any) -> str:
    """On one line if it is short, else a line for each argument; annotations as they are written."""
    signature = inspect.signature(function)
    shown = [text for text in map(_argument, signature.parameters.values()) if text != "self"]
    if any(p.kind is inspect.Parameter.KEYWORD_ONLY for p in signature.parameters.values()):
        first = next(i for i, p in enumerate(signature.parameters.values()) if p.kind is p.KEYWORD_ONLY)
        shown.insert(first, "*")
    returns = "" if signature.return_annotation is signature.empty else f" -> {signature.return_annotation}"
    short = f"{name}({', '.join(shown)}){returns}"
    if len(short) <= 90:
        return short
    return f"{name}(\n" + "".join(f"    {text},\n" for text in shown) + f"){returns}"


def _argument(parameter: inspect.Parameter) -> str:
    if parameter.annotation is parameter.empty:
        return parameter.name
    text = f"{parameter.name}: {parameter.annotation}"
    return text if parameter.default is parameter.empty else f"{text} = {parameter.default!r}"


def _attributes(thing: Any) -> list[tuple[str, str, str]]:
    """Fields of a dataclass with the string that stands below each."""
    source = Path(inspect.getsourcefile(thing) or "").read_text(encoding="utf-8")
    rows = []
    for field in dataclasses.fields(thing):
        said = re.search(rf'^    {field.name}: .*\n    """([^"]*)"""', source, re.MULTILINE)
        rows.append((f"`{field.name}`", f"`{field.type}`", " ".join(said[1].split()) if said else ""))
    return rows
