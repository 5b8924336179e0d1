"""The vehicle description: airframe, rotors, cable, load, start and surroundings, from one TOML file.

Both processes read the same description, so there is no second copy of any figure. Units are SI,
the world is ENU with z up, the body FLU; angles are in radians.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import annotated_types
import numpy as np
from pydantic import BaseModel, Field, ValidationError, model_validator
from pydantic.fields import FieldInfo

from sitl_bridge.ids import ACTUATOR_CONTROLS
from sitl_bridge.schema import Section, Vector, quantity
from sitl_bridge.sensors import Sensors

Model = TypeVar("Model", bound=Section)


class Drag(Section):
    """Drag of a body in air, F = -(k_1 + k_2 |v|) v with v its velocity through the air."""

    linear: float = quantity("N s/m", "k_1, on each axis alike", 0.0, ge=0, le=1e3)
    quadratic: float = quantity("N s²/m²", "k_2, half of air density times drag area", 0.0, ge=0, le=1e3)


class Airframe(Section):
    mass: float = quantity("kg", "m_v, of the vehicle without load", gt=0, le=1e4)
    inertia: Annotated[
        tuple[
            Annotated[float, Field(gt=0, le=1e5)],
            Annotated[float, Field(gt=0, le=1e5)],
            Annotated[float, Field(gt=0, le=1e5)],
        ],
        Field(description="principal moments of inertia, body axes", json_schema_extra={"unit": "kg m²"}),
    ]
    drag: Drag = Drag()
    legs: tuple[Vector, ...] = quantity(
        "m", "points that touch the ground, body FLU, from the centre of mass", (), max_length=8
    )


class Rotor(Section):
    position: Vector = quantity("m", "of the hub, body FLU, from the centre of mass")
    direction: Literal["cw", "ccw"] = quantity("-", "seen from above; ccw gives a reaction torque about -z")
    thrust_coefficient: float = quantity("N s²/rad²", "c_T of eq. 5", gt=0)
    torque_coefficient: float = quantity("N m s²/rad²", "c_Q of eq. 12", ge=0)
    max_speed: float = quantity("rad/s", "largest speed, at control 1", gt=0, le=1e5)
    diameter: float | None = quantity(
        "m",
        "of the disc: the battery's drain is momentum theory's; without one, that of c_Q",
        None,
        gt=0,
        le=20,
    )
    time_constant: float = quantity("s", "of the speed's first-order lag; 0: no lag", 0.0, ge=0, le=10)


class Cable(Section):
    stiffness: float = quantity("N/m", "k_a of eq. 9", gt=0, le=1e6)
    damping: float = quantity("N s/m", "c_a of eq. 9", 0.0, ge=0, le=1e5)
    rest_length: float = quantity("m", "l_0 of eq. 9", gt=0, le=1e3)
    model: Literal["two-way", "tension-only"] = quantity(
        "-",
        "two-way also pushes below its rest length (the paper's); tension-only never does",
        "tension-only",
    )
    breaking_tension: float | None = quantity("N", "more than this, and the cable breaks", None, gt=0)


class Load(Section):
    mass: float = quantity("kg", "m_p", gt=0, le=1e4)
    radius: float = quantity("m", "height of its centre above the ground that it lies on", 0.0, ge=0, le=10)
    drag: Drag = Drag()


class Ground(Section):
    """Level ground: compliant, with friction. Its stiffness follows from how far it yields to a resting
    body."""

    height: float = quantity("m", "world z of the surface", 0.0)
    sink: float = quantity("m", "how far a body at rest sinks in", 0.003, gt=0, le=0.1)
    damping_ratio: float = quantity("-", "of a resting body's bounce", 0.7, ge=0, le=2)
    friction: float = quantity("-", "coefficient of friction under the legs", 0.6, ge=0, le=5)
    load_friction: float = quantity("-", "coefficient of friction under the load", 0.5, ge=0, le=5)


class Turbulence(Section):
    """Dryden turbulence at low altitude, MIL-F-8785C 3.7.3.4."""

    wind_at_6_m: float = quantity("m/s", "W_20: light 7.7, moderate 15.4, severe 23.1", gt=0, le=60)
    height: float = quantity("m", "height above ground that sets scale and intensity", 10.0, ge=3, le=300)
    airspeed: float = quantity("m/s", "V: how fast the frozen field drifts past", 5.0, gt=0, le=100)


class Gust(Section):
    """One 1-cosine gust: from nothing to the peak and back."""

    start: float = quantity("s", "from the start of the scenario", ge=0)
    duration: float = quantity("s", "from nothing to nothing", gt=0, le=1e3)
    peak: Vector = quantity("m/s", "air velocity at its height, world ENU, on top of the wind")
    acts_on: Literal["both", "vehicle", "load"] = quantity("-", "bodies that it meets", "both")


class Air(Section):
    wind: Vector = quantity("m/s", "steady air velocity, world ENU", (0.0, 0.0, 0.0))
    turbulence: Turbulence | None = None
    gusts: tuple[Gust, ...] = ()


class Battery(Section):
    """A pack of lithium cells: voltage falls with the charge drawn and with the current."""

    cells: int = quantity("-", "in series", ge=1, le=100)
    capacity: float = quantity("A h", "charge of the full pack", gt=0, le=1e4)
    resistance: float = quantity("ohm", "of the whole pack", ge=0, le=10)
    full_cell_voltage: float = quantity("V", "open circuit, full", 4.2, gt=0, le=10)
    empty_cell_voltage: float = quantity("V", "open circuit, empty", 3.5, gt=0, le=10)
    charge: float = quantity("-", "share of the capacity that is left at the start", 1.0, gt=0, le=1)
    drive_efficiency: float = quantity("-", "rotor shaft power over electric power", 0.75, gt=0, le=1)
    figure_of_merit: float = quantity("-", "ideal over shaft power, of rotors", 0.6, gt=0, le=1)
    avionics_power: float = quantity("W", "drawn by everything but the rotors", 5.0, ge=0, le=1e4)


class Initial(Section):
    """Start state: hovering above the load at the equilibrium length, or both at rest on the ground.

    On the ground, positions give east and north only, and the vehicle stands at the origin unless told where.
    """

    start: Literal["hover", "ground"] = quantity(
        "-", "in the air, or on the legs with a slack cable", "hover"
    )
    load_position: Vector = quantity("m", "world ENU", (0.0, 0.0, 0.0))
    vehicle_position: Vector | None = quantity("m", "world ENU", None)
    load_velocity: Vector = quantity("m/s", "world ENU", (0.0, 0.0, 0.0))
    vehicle_velocity: Vector = quantity("m/s", "world ENU", (0.0, 0.0, 0.0))
    attitude: Vector = quantity("rad", "roll, pitch, yaw (about X, Y, Z; R = Rz Ry Rx)", (0.0, 0.0, 0.0))
    body_rates: Vector = quantity("rad/s", "p, q, r, body FLU", (0.0, 0.0, 0.0))


class Disturbance(Section):
    force_std: float = quantity("N", "standard deviation on each axis of a white force", 0.0, ge=0, le=1e4)
    hold_time: float = quantity("s", "each draw of the white force is held so long", 0.01, gt=0, le=10)
    acts_on: Literal["both", "vehicle", "load"] = quantity("-", "bodies that the white force acts on", "both")


class Loop(Section):
    delay_ticks: int = quantity("ticks", "the plant applies each command so many ticks later", 0, ge=0, le=64)


class Home(Section):
    """Where the world's origin lies; Zurich by default, as PX4's own simulator has it."""

    latitude: float = quantity("deg", "WGS 84", 47.397742, ge=-89, le=89)
    longitude: float = quantity("deg", "WGS 84", 8.545594, ge=-180, le=180)
    altitude: float = quantity("m", "above mean sea level", 488.0, ge=-500, le=9000)


class Vehicle(Section):
    """One vehicle, complete: what the plant simulates and what the autopilot is designed for."""

    name: str = quantity("-", "short name", min_length=1)
    description: str = quantity("-", "one line, with where the figures come from", "")
    gravity: float = quantity("m/s²", "g", 9.81, gt=0, le=30)
    airframe: Airframe
    rotors: tuple[Rotor, ...] = quantity(
        "-", "in the order of the actuator controls", min_length=4, max_length=ACTUATOR_CONTROLS
    )
    cable: Cable
    load: Load
    initial: Initial = Initial()
    disturbance: Disturbance = Disturbance()
    ground: Ground | None = None
    air: Air = Air()
    battery: Battery | None = None
    sensors: Sensors = Sensors()
    loop: Loop = Loop()
    home: Home = Home()

    @model_validator(mode="after")
    def _can_hover(self) -> Vehicle:
        available = sum(rotor.thrust_coefficient * rotor.max_speed**2 for rotor in self.rotors)
        if available <= self.hover_thrust:
            raise ValueError(
                f"rotors give {available:.4g} N at full speed, hovering takes {self.hover_thrust:.4g} N"
            )
        if self.initial.vehicle_position == self.initial.load_position:
            raise ValueError("initial.vehicle_position equals initial.load_position: no cable direction")
        return self

    @model_validator(mode="after")
    def _can_stand(self) -> Vehicle:
        if self.ground is not None and len(self.airframe.legs) < 3:
            raise ValueError("airframe.legs: on ground a vehicle needs three or more; expected points in m")
        if self.ground is None and self.initial.start == "ground":
            raise ValueError("initial.start = 'ground': there is no [ground] table")
        if self.initial.start == "ground" and self.initial_length > self.cable.rest_length:
            raise ValueError(
                f"initial: the load lies {self.initial_length:.4g} m from the vehicle, "
                f"further than cable.rest_length = {self.cable.rest_length:.4g} m"
            )
        return self

    @property
    def hover_thrust(self) -> float:
        """Total thrust that carries vehicle and load, N (eq. 19)."""
        return (self.airframe.mass + self.load.mass) * self.gravity

    @property
    def hover_length(self) -> float:
        """Cable length at the hover equilibrium, m (eq. 17, corrected: l_0 + m_p g / k_a)."""
        return self.cable.rest_length + self.load.mass * self.gravity / self.cable.stiffness

    @property
    def initial_vehicle_position(self) -> Vector:
        """Where the vehicle starts, m, world ENU: as given, in equilibrium above the load, or on its legs."""
        if self.initial.start == "ground" and self.ground is not None:
            x, y, _ = self.initial.vehicle_position or (0.0, 0.0, 0.0)
            return (x, y, self.ground.height - min(leg[2] for leg in self.airframe.legs) - self.ground.sink)
        if self.initial.vehicle_position is not None:
            return self.initial.vehicle_position
        x, y, z = self.initial.load_position
        return (x, y, z + self.hover_length)

    @property
    def initial_load_position(self) -> Vector:
        """Where the load starts, m, world ENU: as given, or lying on the ground there."""
        x, y, z = self.initial.load_position
        if self.initial.start == "ground" and self.ground is not None:
            z = self.ground.height + self.load.radius - self.ground.sink
        return (x, y, z)

    @property
    def initial_length(self) -> float:
        """Distance from vehicle to load at the start, m."""
        return math.dist(self.initial_vehicle_position, self.initial_load_position)


class DescriptionError(ValueError):
    """A faulty description; `faults` has one line for each fault."""

    def __init__(self, source: str, faults: list[str]) -> None:
        self.source = source
        self.faults = faults
        super().__init__("\n".join(f"{source}: {fault}" for fault in faults))


def shipped(folder: Any) -> list[str]:
    """Names of the TOML files in a resource folder, without the suffix."""
    return sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".toml"))


def vehicle_names() -> list[str]:
    """Names of the vehicles that come with the package."""
    return shipped(resources.files(__package__) / "vehicles")


def preset_names() -> list[str]:
    """Names of the sensor presets that come with the package."""
    return shipped(resources.files(__package__) / "presets")


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


def load_vehicle(name_or_file: str, overrides: Iterable[str] = ()) -> Vehicle:
    """Load a vehicle by shipped name or path, with `KEY=VALUE` overrides (`cable.rest_length=10`).

    Raises DescriptionError, with one line for each fault.
    """
    source, content = read_toml(name_or_file, resources.files(__package__) / "vehicles", "vehicle")
    for override in overrides:
        apply_override(content, override)
    if isinstance(sensors := content.get("sensors"), dict) and "preset" in sensors:
        _, preset = read_toml(str(sensors["preset"]), resources.files(__package__) / "presets", "preset")
        content["sensors"] = _merged(preset, sensors)
    return validated(Vehicle, content, source)


def _merged(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Nested tables with some values replaced."""
    out = dict(base)
    for key, value in changes.items():
        old = out.get(key)
        out[key] = _merged(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return out


def apply_override(content: dict[str, Any], override: str) -> None:
    """Set one value of nested tables from `table.key=VALUE`, VALUE being TOML or a bare word."""
    key, equals, text = override.partition("=")
    path = key.strip().split(".")
    if not equals or not all(path):
        raise DescriptionError("--set", [f"{override!r}: expected KEY=VALUE, as in cable.rest_length=10"])
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
                raise DescriptionError("--set", [f"{key}: {step!r} is no index of a list of {len(target)}"])
            place = int(step)
        elif not isinstance(target, dict):
            raise DescriptionError("--set", [f"{key}: {step!r} lies below a value that is not a table"])
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
        raise DescriptionError(source, [_fault_line(model, fault) for fault in own]) from None


def _tuples(value: Any) -> Any:
    """TOML's lists as the tuples that the models are made of."""
    if isinstance(value, Mapping):
        return {key: _tuples(entry) for key, entry in value.items()}
    return tuple(_tuples(entry) for entry in value) if isinstance(value, list) else value


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


def _fault_line(model: type[BaseModel], fault: Any) -> str:
    """One line for one fault: key, value, unit, allowed range."""
    where = ".".join(str(part) for part in fault["loc"])
    field = _field_at(model, fault["loc"])
    unit = _unit(field)
    problem = _PROBLEMS.get(fault["type"], fault["msg"].removeprefix("Value error, "))
    if fault["type"] == "missing":
        return f"{where}: missing; expected {_expectation(field) or 'a value'}{f' in {unit}' if unit else ''}"
    if fault["type"] == "extra_forbidden":
        return f"{where} = {_shown(fault['input'])}: no such key"
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


def hover_rotor_speed(vehicle: Vehicle) -> float:
    """Rotor speed of hover for a vehicle with equal rotors, rad/s (eq. 24, corrected)."""
    total = sum(rotor.thrust_coefficient for rotor in vehicle.rotors)
    return math.sqrt(vehicle.hover_thrust / total)


def hover_rotor_speeds(vehicle: Vehicle) -> tuple[float, ...]:
    """Rotor speeds that carry vehicle and load without any moment, for any layout, rad/s."""
    effect = np.array(
        [
            (
                rotor.thrust_coefficient,
                rotor.position[1] * rotor.thrust_coefficient,
                -rotor.position[0] * rotor.thrust_coefficient,
                (-1.0 if rotor.direction == "ccw" else 1.0) * rotor.torque_coefficient,
            )
            for rotor in vehicle.rotors
        ]
    ).T
    squared, *_ = np.linalg.lstsq(effect, np.array([vehicle.hover_thrust, 0.0, 0.0, 0.0]), rcond=None)
    return tuple(np.sqrt(np.maximum(squared, 0.0)).tolist())
