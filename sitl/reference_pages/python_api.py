"""The Python interface: signatures and docstrings of what is public."""

from __future__ import annotations

import dataclasses
import inspect
import re
import textwrap
from typing import Any

from controller.own_law import interface
from sitl import api, testing
from sitl.reference_pages.tables import page, table

PUBLIC: tuple[tuple[str, Any], ...] = (
    ("sitl.fly", api.fly),
    ("sitl.Flight", api.Flight),
    ("sitl.testing.flying_vehicle", testing.flying_vehicle),
    ("sitl.testing.SimulatedVehicle", testing.SimulatedVehicle),
    ("controller.own_law.interface.OwnLaw", interface.OwnLaw),
    ("controller.own_law.interface.Estimate", interface.Estimate),
    ("controller.own_law.interface.Reference", interface.Reference),
    ("controller.own_law.interface.Wrench", interface.Wrench),
)
_ARGUMENTS = re.compile(r"^Arguments:\n((?:    .*\n?)+)", re.MULTILINE)


def markdown() -> str:
    """The page."""
    fixture = [
        "## The pytest fixture `sitl_vehicle`",
        "",
        "Installed with the package: `def test_mine(sitl_vehicle): …` gets a",
        "`sitl.testing.SimulatedVehicle` on free ports, on the ground and disarmed.",
    ]
    sections = [_section(name, thing) for name, thing in PUBLIC]
    sources = (
        "`sitl/api.py`, `sitl/testing.py`, `controller/own_law/interface.py` and `sitl/gym/environment.py`"
    )
    return page("Python interface", sources, *sections[:4], fixture, *sections[4:], _environment())


def _environment() -> list[str]:
    """The section on the Gymnasium environment; this page is made where the extra [gym] is installed."""
    from sitl.gym.environment import SlungLoad

    lines = [f"## `sitl.gym.environment.{SlungLoad.__name__}`", "", *_documentation(SlungLoad)]
    for method in (SlungLoad.__init__, SlungLoad.reset, SlungLoad.step):
        lines += ["", "```python", _signature(method.__name__, method), "```", "", *_documentation(method)]
    return lines


def _section(name: str, thing: Any) -> list[str]:
    lines = [f"## `{name}`", ""]
    if not inspect.isclass(thing):
        lines += ["```python", _signature(name, thing), "```", ""]
    lines += _documentation(thing)
    if inspect.isclass(thing):
        if rows := _attributes(thing):
            lines += ["", *table(("attribute", "type", "meaning"), rows)]
        for method, function in inspect.getmembers(thing, inspect.isfunction):
            own = function.__qualname__.startswith(thing.__name__) and function.__doc__
            if own and (method == "__init__" or not method.startswith("_")):
                first, *rest = _documentation(function)
                lines += ["", f"`{_signature(method, function)}`: {first}", *rest]
    return lines


def _documentation(thing: Any) -> list[str]:
    """Lines of a docstring; its arguments are a table."""
    text = inspect.getdoc(thing) or ""
    found = _ARGUMENTS.search(text)
    if found is None:
        return text.splitlines()
    arguments: list[list[str]] = []
    for line in textwrap.dedent(found[1]).splitlines():
        if line.startswith(" "):
            arguments[-1][1] += f" {line.strip()}"
        else:
            name, _, meaning = line.partition(": ")
            arguments.append([f"`{name}`", meaning])
    after = text[found.end() :].strip("\n").splitlines()
    rows = [(name, meaning[0].upper() + meaning[1:]) for name, meaning in arguments]
    return [*text[: found.start()].splitlines(), *table(("argument", "meaning"), rows), "", *after]


def _signature(name: str, function: Any) -> str:
    """On one line if it is short, else a line for each argument; annotations as they are written."""
    signature = inspect.signature(function)
    parameters = [p for p in signature.parameters.values() if p.name != "self"]
    shown = [_argument(parameter) for parameter in parameters]
    by_name_only = [i for i, p in enumerate(parameters) if p.kind is p.KEYWORD_ONLY]
    if by_name_only:
        shown.insert(by_name_only[0], "*")
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
    """Fields of a dataclass or named tuple with the string that stands below each."""
    if dataclasses.is_dataclass(thing):
        fields = [(field.name, str(field.type)) for field in dataclasses.fields(thing)]
    else:
        kinds = inspect.get_annotations(thing)
        fields = [(name, _written(kinds[name])) for name in getattr(thing, "_fields", ())]
    source = inspect.getsource(thing)
    rows = []
    for name, kind in fields:
        said = re.search(rf'^    {name}: .*\n    """([^"]*)"""', source, re.MULTILINE)
        rows.append((f"`{name}`", f"`{kind}`", " ".join(said[1].split()) if said else ""))
    return rows


def _written(annotation: Any) -> str:
    """An annotation as it is in the source."""
    return str(getattr(annotation, "__forward_arg__", annotation))
