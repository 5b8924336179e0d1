"""Descriptions as files: TOML by name or path, changed by `KEY=VALUE`, with a line for each fault in it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import deepcopy
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.errors import DescriptionError, Location, did_you_mean, fault_lines
from sitl_bridge.vehicle.overrides import Override, apply_overrides
from sitl_bridge.vehicle.physics import PhysicsFault, physics_faults
from sitl_bridge.vehicle.schema import Section
from sitl_bridge.vehicle.sensors import Sensors
from sitl_bridge.vehicle.toml_files import toml_content, toml_text, what_is_wrong
from sitl_bridge.vehicle.toml_lines import line_of

__all__ = [
    "DescriptionError",
    "Override",
    "beside",
    "completed",
    "is_path",
    "load_vehicle",
    "preset_names",
    "read_toml",
    "shipped",
    "validated",
    "vehicle_names",
]
Model = TypeVar("Model", bound=Section)
Origin = Callable[[Location], str]
"""Where a value comes from, for the end of a message: a line of its file, or a flag; empty: unknown."""


def shipped(folder: Any) -> list[str]:
    """Names of the TOML files in a resource folder, without the suffix."""
    return sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".toml"))


def vehicle_names() -> list[str]:
    """Names of the vehicles that come with the package."""
    return shipped(resources.files("sitl_bridge") / "vehicles")


def preset_names() -> list[str]:
    """Names of the sensor presets that come with the package."""
    return shipped(resources.files("sitl_bridge") / "presets")


def is_path(name_or_file: str) -> bool:
    """Whether a file is meant, and not the name of a shipped one."""
    return name_or_file.endswith(".toml") or "/" in name_or_file


def beside(name_or_file: str, source: str) -> str:
    """A name or path as a file says it, from where the program runs: paths are relative to that file."""
    if is_path(name_or_file) and is_path(source):
        return str(Path(source).parent / name_or_file)
    return name_or_file


def read_toml(name_or_file: str, folder: Any, kind: str) -> tuple[str, dict[str, Any]]:
    """Read a shipped TOML file by name, or any by path; returns (source for messages, content).

    Raises DescriptionError when there is no such file or it is not TOML.
    """
    entry = Path(name_or_file) if is_path(name_or_file) else folder / f"{name_or_file}.toml"
    try:
        return name_or_file, deepcopy(toml_content(toml_text(entry)))
    except FileNotFoundError:
        known = shipped(folder)
        raise DescriptionError(
            name_or_file,
            [
                f"no such {kind}; expected one of {', '.join(known)}, or the path of a .toml file"
                f"{did_you_mean(name_or_file, known)}"
            ],
        ) from None
    except (OSError, ValueError) as error:
        raise DescriptionError(name_or_file, [what_is_wrong(error)]) from None


def load_vehicle(vehicle: str | Vehicle, overrides: Iterable[str | Override] = ()) -> Vehicle:
    """Load a vehicle by shipped name or path, with `KEY=VALUE` overrides (`cable.rest_length=10`).

    A complete vehicle can be changed by overrides, too. Raises DescriptionError, with one line for each
    fault.
    """
    changes = [o if isinstance(o, Override) else Override(o) for o in overrides]
    said_by = _origin("", changes)(("sensors", "preset"))
    if isinstance(vehicle, Vehicle):
        source, content = vehicle.name, vehicle.model_dump(mode="json", exclude_none=True)
        if said_by:
            content["sensors"] = _own_sensors(content["sensors"])
    else:
        source, content = read_toml(vehicle, resources.files("sitl_bridge") / "vehicles", "vehicle")
    apply_overrides(content, changes)
    return validated(Vehicle, completed(content, "" if said_by else source), source, _origin(source, changes))


def completed(content: dict[str, Any], source: str = "") -> dict[str, Any]:
    """A vehicle's content with its sensors on top of their preset. source: the file that names the preset."""
    sensors = content.get("sensors")
    return {**content, "sensors": _on_preset(sensors, source)} if isinstance(sensors, dict) else content


def _on_preset(sensors: dict[str, Any], source: str) -> dict[str, Any]:
    """The sensors' table on top of the preset that it names, and that on top of its own.

    source: the file that names the preset.
    """
    names: list[str] = []
    complete = sensors
    below = sensors
    while "preset" in below:
        name = beside(str(below["preset"]), source)
        if name in names:
            raise DescriptionError(name, [f"preset: is based on itself ({' on '.join([*names, name])})"])
        names.append(name)
        source, below = read_toml(name, resources.files("sitl_bridge") / "presets", "preset")
        complete = _merged(below, complete)
    return complete


def _own_sensors(sensors: dict[str, Any]) -> dict[str, Any]:
    """What a complete vehicle's sensors have that is not of the preset which they name."""
    preset = validated(Sensors, _on_preset({"preset": sensors["preset"]}, ""), str(sensors["preset"]))
    return _differences(preset.model_dump(mode="json", exclude_none=True), sensors)


def _differences(base: dict[str, Any], table: dict[str, Any]) -> dict[str, Any]:
    """The values of nested tables that are not those of the base."""
    out: dict[str, Any] = {}
    for key, value in table.items():
        old = base.get(key)
        if isinstance(old, dict) and isinstance(value, dict):
            out[key] = _differences(old, value)
        elif value != old:
            out[key] = value
    return out


def _merged(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Nested tables with some values replaced."""
    out = dict(base)
    for key, value in changes.items():
        old = out.get(key)
        out[key] = _merged(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return out


def _origin(source: str, overrides: Sequence[Override]) -> Origin:
    """Of the values of a file that overrides have changed."""

    def origin(location: Location) -> str:
        for override in reversed(overrides):
            if all(a == b for a, b in zip(override.keys, location, strict=False)):
                return override.source
        if not is_path(source) or not location:
            return ""
        try:
            line = line_of(toml_text(Path(source)), location)
        except (OSError, ValueError):  # it was there a moment ago
            return ""
        return "" if line is None else f"line {line}"

    return origin


def validated(
    model: type[Model], content: Mapping[str, Any], source: str, origin: Origin | None = None
) -> Model:
    """Validate a parsed file against its model; raises DescriptionError with a line for each fault."""
    complete = _tuples(content)
    try:
        return model.model_validate(complete)
    except ValidationError as error:
        faults = fault_lines(model, error.errors())
    if model is Vehicle:
        faults += _of_sound_tables(complete, {str(fault.location[0]) for fault in faults if fault.location})
    said: dict[str, None] = {}
    for fault in faults:
        place = (origin or _origin(source, ()))(fault.location)
        said[f"{fault.text} ({place})" if place else fault.text] = None
    raise DescriptionError(source, said)


def _of_sound_tables(content: Mapping[str, Any], faulty: set[str]) -> list[PhysicsFault]:
    """Faults of physics in the tables of a faulty description that are valid by themselves."""
    fields = Vehicle.model_fields
    kinds: dict[str, Any] = {name: field.annotation for name, field in fields.items()}
    sound = {
        name: TypeAdapter(kind).validate_python(content[name])
        for name, kind in kinds.items()
        if name in content and name not in faulty
    }
    defaults = {name for name, field in fields.items() if not field.is_required()}
    return physics_faults(Vehicle.model_construct(**sound), (defaults - faulty) | sound.keys())


def _tuples(value: Any) -> Any:
    """TOML's lists as the tuples that the models are made of."""
    if isinstance(value, Mapping):
        return {key: _tuples(entry) for key, entry in value.items()}
    return tuple(_tuples(entry) for entry in value) if isinstance(value, list) else value
