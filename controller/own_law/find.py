"""Find a law by name, and make sure that it can be flown. Raises DescriptionError with one line."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from controller.own_law.blame import cause, one_line
from controller.own_law.interface import OwnLaw
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import DescriptionError

EXPECTED = "expected MODULE:NAME or FILE.py:NAME"


class ChosenLaw(NamedTuple):
    """A law's class, and what to call it in messages and summaries."""

    name: str
    make: Callable[..., OwnLaw]


def choose(law: str | Callable[..., OwnLaw]) -> ChosenLaw:
    """A law given by name or as its class."""
    if not isinstance(law, str):
        return ChosenLaw(getattr(law, "__name__", type(law).__name__), law)
    place, colon, name = law.rpartition(":")
    if not (colon and place and name):
        raise DescriptionError(f"--law {law}", [EXPECTED])
    module = _from_file(law, Path(place)) if place.endswith(".py") else _by_name(law, place)
    if not hasattr(module, name):
        classes = [key for key, value in vars(module).items() if _is_law(value, module)]
        found = f"it has {', '.join(classes)}" if classes else "it has no class with a method `step`"
        raise DescriptionError(f"--law {law}", [f"there is no {name} in {place}; {found}"])
    return ChosenLaw(law, getattr(module, name))


def make(law: ChosenLaw, vehicle: Vehicle, rate_hz: float) -> OwnLaw:
    """A new object of the law."""
    where = f"--law {law.name}"
    if not callable(law.make):
        raise DescriptionError(where, [f"{one_line(law.make)} is not a class; expected one with `step`"])
    _check_takes(where, law.make, "the constructor", keywords=("vehicle", "rate_hz"))
    try:
        made = law.make(vehicle=vehicle, rate_hz=rate_hz)
    except (Exception, SystemExit) as error:
        raise DescriptionError(where, [f"the constructor raised {cause(error, law.make)}"]) from error
    step = getattr(made, "step", None)
    if not callable(step):
        raise DescriptionError(where, ["it has no method step(estimate, reference)"])
    _check_takes(where, step, "step", positional=("estimate", "reference"))
    return made


def _check_takes(
    where: str,
    function: Callable[..., Any],
    what: str,
    positional: tuple[str, ...] = (),
    keywords: tuple[str, ...] = (),
) -> None:
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # of a class in C: the call itself will show
        return
    try:
        signature.bind(*positional, **dict.fromkeys(keywords))
    except TypeError as error:
        expected = ", ".join((*positional, *(f"{key}=" for key in keywords)))
        raise DescriptionError(where, [f"{what} takes {signature}; expected ({expected}): {error}"]) from None


def _is_law(value: object, module: ModuleType) -> bool:
    return inspect.isclass(value) and value.__module__ == module.__name__ and hasattr(value, "step")


def _from_file(law: str, file: Path) -> ModuleType:
    if not file.is_file():
        raise DescriptionError(f"--law {law}", [f"there is no file {file}"])
    file = file.resolve()
    if str(file.parent) not in sys.path:
        sys.path.append(str(file.parent))  # for what lies beside it, as if Python ran the file
    name = f"own_law_{file.stem}"
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    before = sys.modules.get(name)
    sys.modules[name] = module  # dataclasses look themselves up there
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        if before is None:
            del sys.modules[name]
        else:
            sys.modules[name] = before
        raise DescriptionError(f"--law {law}", [cause(error, file=str(file))]) from error
    return module


def _by_name(law: str, name: str) -> ModuleType:
    here = str(Path.cwd())
    if here not in sys.path and "" not in sys.path:
        sys.path.append(here)
    try:
        return importlib.import_module(name)
    except (Exception, SystemExit) as error:
        raise DescriptionError(f"--law {law}", [cause(error)]) from error
