"""Fly one draw of a study: inputs in, a row out. Whatever goes wrong is a row, too."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sitl.api import Flight, fly
from sitl.flights.scenario import Scenario, load_scenario, scenario_vehicle
from sitl.report.outcome import FELL
from sitl.studies.random_vehicles import random_vehicle
from sitl.studies.sweep.own_values import of_own
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import DescriptionError, load_vehicle

OWN_KEYS = ("vehicle", "design", "feedback", "seed", "duration", "rate_hz")
"""Keys that are arguments of a flight, and nothing of the vehicle."""


def fly_draw(study: dict[str, Any], draw: dict[str, Any], logs: str | None) -> dict[str, Any]:
    """The row of one flight. study: a `Study` as plain values; draw: its inputs; logs: where failures' go."""
    started = time.perf_counter()
    row: dict[str, Any] = {"outcome": "raised", "outcome_time_s": None, "outcome_cause": None}
    try:
        flight = _fly(study, draw, None)
        row |= _figures(study, flight)
        if logs is not None and (study["logs"] == "all" or flight.summary["outcome"] in FELL):
            _fly(study, draw, Path(logs))
    except DescriptionError as error:
        row |= {"outcome": "refused", "outcome_cause": str(error)}
    except Exception as error:  # a flight that raises is a row of the study, not its end
        row |= {"outcome": "raised", "outcome_cause": f"{type(error).__name__}: {error}"}
    row["wall_time_s"] = time.perf_counter() - started
    return row


class Drawn(NamedTuple):
    """What a draw makes of its study's scenario."""

    scenario: Scenario
    vehicle: Vehicle | str | None
    """None: the scenario's."""
    overrides: list[str]
    plant_overrides: list[str]

    @property
    def told(self) -> Vehicle:
        """The vehicle as the controller is told."""
        return scenario_vehicle(self.scenario, self.vehicle, self.overrides)


def drawn(study: dict[str, Any], draw: dict[str, Any]) -> Drawn:
    """Apply a draw. study: a `Study` as plain values. Raises DescriptionError."""
    overrides: list[str] = list(study["set"])
    plant_overrides: list[str] = []
    scenario = load_scenario(study["scenario"])
    vehicle = _vehicle(study, draw)
    changes = {vary["key"]: vary["of_own"] for vary in study["vary"] if vary["of_own"] is not None}
    for key, value in draw.items():
        bare = key.removeprefix("plant.")
        if key in changes:
            told = scenario_vehicle(scenario, vehicle, overrides)
            changed = of_own(told.model_dump(), bare, float(value), changes[key])
            texts = [f"{name}={_toml(number)}" for name, number in changed.items()]
            (plant_overrides if key.startswith("plant.") else overrides).extend(texts)
        elif key.startswith("plant."):
            plant_overrides.append(f"{bare}={_toml(value)}")
        elif key.startswith("reference."):
            scenario = with_reference(scenario, key.removeprefix("reference."), value)
        elif key not in (*OWN_KEYS, "random_vehicle"):
            overrides.append(f"{key}={_toml(value)}")
    return Drawn(scenario, vehicle, overrides, plant_overrides)


def _fly(study: dict[str, Any], draw: dict[str, Any], out: Path | None) -> Flight:
    found = drawn(study, draw)
    duration = draw.get("duration", study["duration"])
    return fly(
        found.scenario,
        vehicle=found.vehicle,
        overrides=found.overrides,
        plant_overrides=found.plant_overrides,
        seed=int(draw["seed"]),
        design=str(draw["design"]),
        feedback=draw.get("feedback"),
        rate_hz=float(draw.get("rate_hz", 250.0)),
        duration_s=None if duration is None else float(duration),
        out=out,
    )


def _vehicle(study: dict[str, Any], draw: dict[str, Any]) -> Vehicle | str | None:
    if "random_vehicle" in draw:
        generator = np.random.default_rng(int(draw["random_vehicle"]))
        return random_vehicle(generator, **study["random_vehicles"])
    name = draw.get("vehicle")
    return None if name is None else load_vehicle(str(name)) if str(name).endswith(".toml") else str(name)


def with_reference(scenario: Scenario, key: str, value: Any) -> Scenario:
    """The scenario with one value of its reference changed (`position.0`). Raises DescriptionError."""
    name, *indices = key.split(".")
    content = scenario.reference.model_dump()
    if name not in content:
        raise DescriptionError(f"reference.{key}", [f"a {content['kind']} has {', '.join(sorted(content))}"])
    content[name] = _with_entry(content[name], indices, value, f"reference.{key}") if indices else value
    try:
        return Scenario.model_validate({**scenario.model_dump(), "reference": content})
    except ValueError as error:
        raise DescriptionError(f"reference.{key}", [str(error).splitlines()[0]]) from None


def _with_entry(entries: Any, indices: Sequence[str], value: Any, key: str) -> tuple[Any, ...]:
    """A list with one number changed, found by an index in it, and in what is there, and so on."""
    index, *deeper = indices
    out = list(entries) if isinstance(entries, tuple) else []
    if not index.isdecimal() or int(index) >= len(out):
        raise DescriptionError(key, [f"expected an index below {len(out)}" if out else "it has no index"])
    at = int(index)
    out[at] = _with_entry(out[at], deeper, value, key) if deeper else float(value)
    return tuple(out)


def _figures(study: dict[str, Any], flight: Flight) -> dict[str, Any]:
    """Outcome and the figures that the study keeps."""
    states, summary = flight.states, flight.summary
    up = 1.0 - 2.0 * (states["attitude_qx"] ** 2 + states["attitude_qy"] ** 2)
    points = summary["points"] or [summary]
    more = {
        "largest_overshoot_pct": max((p["overshoot_pct"] or 0.0 for p in points), default=None),
        "largest_tilt_deg": math.degrees(math.acos(max(-1.0, float(np.min(up))))),
        "largest_tension_N": float(np.max(states["cable_tension_N"])),
        "smallest_tension_N": float(np.min(states["cable_tension_N"])),
        "largest_error_m": float(
            np.max(
                np.linalg.norm(
                    np.stack([states[f"load_{a}_m"] for a in "xyz"], axis=1) - flight.reference, axis=1
                )
            )
        ),
    }
    known = {**summary, **more}
    keep = ("outcome", "outcome_time_s", "outcome_cause", *study["figures"])
    return {key: known.get(key) for key in keep}


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    return repr(value) if isinstance(value, (int, float)) else str(value)
