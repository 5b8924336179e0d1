"""A scenario: which vehicle flies for how long, and where its load is to be. Small TOML files."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

from pydantic import Field

from sitl_bridge.plant.faults.schedule import Faults
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import (
    DescriptionError,
    Override,
    beside,
    is_path,
    load_vehicle,
    read_toml,
    shipped,
    validated,
)
from sitl_bridge.vehicle.schema import Section, Vector, quantity

if TYPE_CHECKING:
    from controller.law.reference import Path


MOST_POINTS = 50
"""Of a sequence: each leg takes tenths of a second to plan."""


def _agility() -> Any:
    return quantity("-", "how fast: 0, gentle, to 1, all that the vehicle can do", None, ge=0, le=1)


class Hover(Section):
    """The load stays where it is when the flight begins."""

    kind: Literal["hover"]

    def path(self, start: Vector) -> Path:
        """The reference path for a load that is at `start` (m, world) when the flight begins."""
        from controller.law.reference import setpoint

        return setpoint(start, start)


class Setpoint(Section):
    """The load goes to a point and stays."""

    kind: Literal["setpoint"]
    position: Vector = quantity("m", "world ENU")
    agility: float | None = _agility()

    def path(self, start: Vector) -> Path:
        """The reference path for a load that is at `start` (m, world) when the flight begins."""
        from controller.law.reference import setpoint

        return _agile(setpoint(self.position, start), self.agility)


class Points(Section):
    """The load goes from point to point and stays a while at each; at the last one for good."""

    kind: Literal["points"]
    positions: tuple[Vector, ...] = quantity(
        "m", "world ENU, in this order", min_length=1, max_length=MOST_POINTS
    )
    hold: float = quantity("s", "from the end of the motion to a point to the next one's", 2.0, ge=0, le=1e4)
    agility: float | None = _agility()

    def path(self, start: Vector) -> Path:
        """The legs (n,) for a load that is at `start` (m, world) when the flight begins."""
        from controller.law.reference import points

        return _agile(points(self.positions, self.hold, start), self.agility)


class Circle(Section):
    """The load goes round: centre + radius·(sin wt, cos wt, 0)."""

    kind: Literal["circle"]
    centre: Vector = quantity("m", "world ENU")
    radius: float = quantity("m", "of the circle", gt=0, le=1e3)
    angular_rate: float = quantity("rad/s", "w", ge=-10, le=10)
    agility: float | None = _agility()

    def path(self, start: Vector) -> Path:
        """The reference path for a load that is at `start` (m, world) when the flight begins."""
        from controller.law.reference import circle

        return _agile(circle(self.centre, self.radius, self.angular_rate, start), self.agility)


class FigureEight(Section):
    """The load flies an eight: centre + radius·(sin wt, sin(2wt)/2, 0)."""

    kind: Literal["figure-eight"]
    centre: Vector = quantity("m", "world ENU, where it crosses itself")
    radius: float = quantity("m", "from the centre to either end", gt=0, le=1e3)
    angular_rate: float = quantity("rad/s", "w: an eight takes 2π/w", ge=-10, le=10)
    agility: float | None = _agility()

    def path(self, start: Vector) -> Path:
        """The reference path for a load that is at `start` (m, world) when the flight begins."""
        from controller.law.reference import figure_eight

        return _agile(figure_eight(self.centre, self.radius, self.angular_rate, start), self.agility)


class Helix(Section):
    """The load goes round and climbs: centre + radius·(sin wt, cos wt, 0) + (0, 0, climb·t)."""

    kind: Literal["helix"]
    centre: Vector = quantity("m", "world ENU, of its lowest turn")
    radius: float = quantity("m", "of the circle", gt=0, le=1e3)
    angular_rate: float = quantity("rad/s", "w", ge=-10, le=10)
    climb: float = quantity("m/s", "upwards, all the time", gt=0, le=20)
    agility: float | None = _agility()

    def path(self, start: Vector) -> Path:
        """The reference path for a load that is at `start` (m, world) when the flight begins."""
        from controller.law.reference import helix

        return _agile(helix(self.centre, self.radius, self.angular_rate, self.climb, start), self.agility)


def _agile(path: Path, agility: float | None) -> Path:
    """The path, with an agility other than the usual one if there is one."""
    if agility is not None:
        path["agility"] = agility
    return path


class GroundControl(Section):
    """Ground control says when to arm and where to go."""

    kind: Literal["ground-control"]


Overrides = Sequence[str | Override]
Moving = Setpoint | Points | Circle | FigureEight | Helix
Reference = Annotated[Hover | Moving | GroundControl, Field(discriminator="kind")]


class Scenario(Section):
    """What `sitl fly NAME` flies."""

    description: str = quantity("-", "one line", "")
    vehicle: str = quantity("-", "name or file of the vehicle")
    set: tuple[str, ...] = quantity("-", "overrides of the vehicle, KEY=VALUE", ())
    plant_set: tuple[str, ...] = quantity("-", "overrides that only the plant has, KEY=VALUE", ())
    duration: float | None = quantity("s", "how long it flies; without it, until it is stopped", None, gt=0)
    feedback: Literal["truth", "estimate"] | None = quantity(
        "-", "what the law flies on, if not as usual", None
    )
    reference: Reference
    faults: Faults = Faults()


def with_agility(scenario: Scenario, agility: float | None) -> Scenario:
    """The scenario with another agility of its reference; None: as it is. Raises DescriptionError."""
    if agility is None:
        return scenario
    if not isinstance(scenario.reference, Moving):
        raise DescriptionError(
            "--agility",
            [f"a {scenario.reference.kind} reference has none; expected one that the load goes to"],
        )
    reference = scenario.reference.model_copy(update={"agility": agility})
    return scenario.model_copy(update={"reference": reference})


def scenario_names() -> list[str]:
    """Names of the scenarios that come with the package."""
    return shipped(_folder())


def load_scenario(name_or_file: str) -> Scenario:
    """Load a scenario by shipped name or path; raises DescriptionError with a line for each fault.

    Paths in it, of its vehicle and of presets that it sets, are relative to its own file.
    """
    source, content = read_toml(name_or_file, _folder(), "scenario")
    scenario = validated(Scenario, content, source)
    beside_it = {key: tuple(_preset_beside(text, source) for text in getattr(scenario, key)) for key in SETS}
    return scenario.model_copy(update={"vehicle": beside(scenario.vehicle, source), **beside_it})


SETS = ("set", "plant_set")
"""Keys of a scenario that are lists of overrides."""


def _preset_beside(text: str, source: str) -> str:
    key, _, value = text.partition("=")
    name = value.strip().strip("\"'")
    return f"{key}={beside(name, source)}" if key.strip() == "sensors.preset" and is_path(name) else text


OF_THE_VEHICLE = ("airframe.", "rotors.", "cable.", "load.", "initial.vehicle_position")
"""Keys that say what a vehicle is, or that fit its cable: a scenario sets them for its own vehicle only."""
HANGING_HEIGHT = 1.0
"""m above the ground, of a load that is to hang at the start and whose description says nothing of it."""


class Suited(NamedTuple):
    """A scenario's overrides for one vehicle, and what was changed for it."""

    overrides: list[Override]
    plant_overrides: list[Override]
    """Those of the plant alone."""
    notes: list[str]
    """One line each, for the person who flies it."""


def suited(scenario: Scenario, vehicle: str | Vehicle | None, overrides: Overrides = ()) -> Suited:
    """What a scenario sets for a vehicle (None: its own), under the overrides that a person has given.

    Another vehicle keeps its own airframe, cable and load. A scenario with a reference of its own begins in
    the air: a vehicle that is described on the ground starts in hover. Raises DescriptionError.
    """
    common, plant_only = _entries("set", scenario.set), _entries("plant_set", scenario.plant_set)
    notes: list[str] = []
    asked_for = vehicle or scenario.vehicle
    name = asked_for.name if isinstance(asked_for, Vehicle) else asked_for
    if name != scenario.vehicle:
        left_out = [entry.text for entry in (*common, *plant_only) if _key(entry).startswith(OF_THE_VEHICLE)]
        common, plant_only = (
            [entry for entry in entries if not _key(entry).startswith(OF_THE_VEHICLE)]
            for entries in (common, plant_only)
        )
        if left_out:
            notes.append(f"{', '.join(left_out)} is for {scenario.vehicle} only: {name} keeps its own")
    if not isinstance(scenario.reference, GroundControl):
        described = load_vehicle(asked_for, [*common, *overrides])
        asked = any(_key(entry) == "initial.start" for entry in overrides)
        if described.initial.start == "ground" and not asked:
            hanging = _hanging(described)
            common = [*common, *(Override(text, "scenario: start in the air") for text in hanging)]
            notes.append(
                f"{name} starts in hover, its load at {_place(hanging)} m: the scenario has no take-off"
            )
    return Suited(common, plant_only, notes)


def scenario_vehicle(scenario: Scenario, vehicle: str | Vehicle | None, overrides: Overrides) -> Vehicle:
    """The scenario's vehicle, or another one, with what the command line says on top."""
    found = suited(scenario, vehicle, overrides)
    return load_vehicle(vehicle or scenario.vehicle, [*found.overrides, *overrides])


def plant_vehicle(scenario: Scenario, vehicle: str | Vehicle | None, overrides: Overrides) -> Vehicle:
    """The vehicle that the plant simulates: the scenario's, with what the autopilot is not told."""
    found = suited(scenario, vehicle, overrides)
    entries = [*found.overrides, *found.plant_overrides, *overrides]
    return load_vehicle(vehicle or scenario.vehicle, entries)


def _hanging(vehicle: Vehicle) -> list[str]:
    """Overrides that let a vehicle hover with its load above the origin, as high as it is described."""
    ground = 0.0 if vehicle.ground is None else vehicle.ground.height
    height = max(vehicle.initial.load_position[2], ground + vehicle.load.radius + HANGING_HEIGHT)
    return ["initial.start=hover", f"initial.load_position=[0.0, 0.0, {height!r}]"]


def _place(overrides: Sequence[str]) -> str:
    return overrides[-1].partition("=")[2]


def _key(entry: str | Override) -> str:
    text = entry.text if isinstance(entry, Override) else entry
    return text.partition("=")[0].strip()


def _entries(key: str, texts: Sequence[str]) -> list[Override]:
    return [Override(text, f"scenario: {key}.{index}") for index, text in enumerate(texts)]


def usual_feedback(scenario: Scenario | None, vehicle: Vehicle) -> str:
    """What a law flies on unless told otherwise: the paper's vehicle on truth, as the paper has it.

    Everything else, and whatever ground control flies, on the estimate from the sensors.
    """
    if scenario is not None and scenario.feedback is not None:
        return scenario.feedback
    guided = scenario is not None and isinstance(scenario.reference, GroundControl)
    return "truth" if vehicle.name == "paper" and not guided else "estimate"


def _folder() -> Any:
    return resources.files(__package__) / "scenarios"
