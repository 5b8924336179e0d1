"""Descriptions as files: TOML by name or path, changed by `KEY=VALUE`, with a line for each fault in it."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from pydantic import ValidationError

from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.errors import fault_line
from sitl_bridge.vehicle.schema import Section

Model = TypeVar("Model", bound=Section)


class DescriptionError(ValueError):
    """A faulty description; `faults` has one line for each fault."""

    def __init__(self, source: str, faults: list[str]) -> None:
        self.source = source
        self.faults = faults
        super().__init__("\n".join(f"{source}: {fault}" for fault in faults))


class Override(NamedTuple):
    """One value of a description to change, `KEY=VALUE`, and where a person has said so."""

    text: str
    source: str = "--set"


def shipped(folder: Any) -> list[str]:
    """Names of the TOML files in a resource folder, without the suffix."""
    return sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".toml"))


def vehicle_names() -> list[str]:
    """Names of the vehicles that come with the package."""
    return shipped(resources.files("sitl_bridge") / "vehicles")


def preset_names() -> list[str]:
    """Names of the sensor presets that come with the package."""
    return shipped(resources.files("sitl_bridge") / "presets")


def read_toml(name_or_file: str, folder: Any, kind: str) -> tuple[str, dict[str, Any]]:
    """Read a shipped TOML file by name, or any by path; returns (source for messages, content).

    Raises DescriptionError when there is no such file or it is not TOML.
    """
    is_path = name_or_file.endswith(".toml") or "/" in name_or_file
    entry = Path(name_or_file) if is_path else folder / f"{name_or_file}.toml"
    try:
        text = entry.read_text(encoding="utf-8")
        return name_or_file, tomllib.loads(text)
    except FileNotFoundError:
        known = ", ".join(shipped(folder))
        raise DescriptionError(
            name_or_file, [f"no such {kind}; expected one of {known}, or the path of a .toml file"]
        ) from None
    except tomllib.TOMLDecodeError as error:
        raise DescriptionError(name_or_file, [f"not valid TOML: {error}"]) from None
    except (OSError, ValueError) as error:  # ValueError: not UTF-8, or no possible path
        raise DescriptionError(name_or_file, [f"cannot be read: {error}"]) from None


def load_vehicle(vehicle: str | Vehicle, overrides: Iterable[str | Override] = ()) -> Vehicle:
    """Load a vehicle by shipped name or path, with `KEY=VALUE` overrides (`cable.rest_length=10`).

    A complete vehicle can be changed by overrides, too. Raises DescriptionError, with one line for each
    fault.
    """
    if isinstance(vehicle, Vehicle):
        source, content = vehicle.name, vehicle.model_dump(exclude_none=True)
    else:
        source, content = read_toml(vehicle, resources.files("sitl_bridge") / "vehicles", "vehicle")
    for override in overrides:
        apply_override(content, override if isinstance(override, Override) else Override(override))
    if isinstance(sensors := content.get("sensors"), dict):
        content["sensors"] = _on_preset(sensors)
    return validated(Vehicle, content, source)


def _on_preset(sensors: dict[str, Any]) -> dict[str, Any]:
    """The sensors' table on top of the preset that it names, and that on top of its own."""
    names: list[str] = []
    complete = sensors
    below = sensors
    while "preset" in below:
        name = str(below["preset"])
        if name in names:
            raise DescriptionError(name, [f"preset: stands on itself ({' on '.join([*names, name])})"])
        names.append(name)
        _, below = read_toml(name, resources.files("sitl_bridge") / "presets", "preset")
        complete = _merged(below, complete)
    return complete


def _merged(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Nested tables with some values replaced."""
    out = dict(base)
    for key, value in changes.items():
        old = out.get(key)
        out[key] = _merged(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return out


def apply_override(content: dict[str, Any], override: Override) -> None:
    """Set one value of nested tables from `table.key=VALUE`, VALUE being TOML or a bare word."""
    key, equals, text = override.text.partition("=")
    path, source = key.strip().split("."), override.source
    if not equals or not all(path):
        raise DescriptionError(source, [f"{override.text!r}: expected KEY=VALUE, as in cable.rest_length=10"])
    try:
        parsed = tomllib.loads(f"value = {text.strip()}")
    except ValueError:
        parsed = {}
    # A bare word is no TOML; more than one value (on lines of their own) is no value either.
    value: Any = parsed["value"] if parsed.keys() == {"value"} else text.strip()
    target: Any = content
    for step, following in zip(path, [*path[1:], None], strict=True):
        place: Any = step
        if isinstance(target, list):
            if not step.isdecimal() or int(step) >= len(target):
                raise DescriptionError(source, [f"{key}: {step!r} is no index of a list of {len(target)}"])
            place = int(step)
        elif not isinstance(target, dict):
            raise DescriptionError(source, [f"{key}: {step!r} lies below a value that is not a table"])
        if following is None:
            target[place] = value
        else:
            target = target[place] if isinstance(target, list) else target.setdefault(place, {})


def validated(model: type[Model], content: Mapping[str, Any], source: str) -> Model:
    """Validate a parsed file against its model; raises DescriptionError with a line for each fault."""
    try:
        return model.model_validate(_tuples(content))
    except ValidationError as error:
        faults = error.errors()
        # A list that seems short only because one of its entries is at fault is no fault of its own.
        followed = {fault["loc"][:1] for fault in faults if len(fault["loc"]) > 1}
        own = [f for f in faults if not (f["type"] == "too_short" and f["loc"] in followed)]
        raise DescriptionError(source, [fault_line(model, fault) for fault in own]) from None


def _tuples(value: Any) -> Any:
    """TOML's lists as the tuples that the models are made of."""
    if isinstance(value, Mapping):
        return {key: _tuples(entry) for key, entry in value.items()}
    return tuple(_tuples(entry) for entry in value) if isinstance(value, list) else value
