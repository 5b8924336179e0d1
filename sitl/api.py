"""Flights from Python: `sitl.fly(...)`, for notebooks and scripts; see docs/python.md.

A flight runs in this process, in lockstep, through the same MAVLink bytes as `sitl fly`. There is no global
state: flights may run side by side in threads or processes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.law.reference import Path as ReferencePath
from controller.own_law.find import choose
from controller.own_law.interface import OwnLaw
from sitl.flights.in_process import InProcessFlight, fly_in_process
from sitl.flights.refusals import check_feasible
from sitl.flights.scenario import (
    GroundControl,
    Scenario,
    plant_vehicle,
    scenario_vehicle,
    usual_feedback,
    with_agility,
)
from sitl.flights.suited_reference import scenario_for
from sitl.json_values import to_json
from sitl.report.metrics import reference_positions
from sitl.report.outcome import judge
from sitl.report.points import as_flown, path_metrics
from sitl.report.sensing_error import sensing_error
from sitl.report.summary import PROMISED, clear, draw, read_state_log, write_report, write_summary
from sitl_bridge.log_amount import Logs
from sitl_bridge.plant.faults.schedule import checked
from sitl_bridge.plant.log.state_log import FILE_NAME
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import DescriptionError, Override

Array = NDArray[np.float64]
DEFAULT_DURATION = 60.0
"""s, of a scenario that has none."""


@dataclass(frozen=True)
class Flight:
    """The result of a flight. World ENU, body FLU, SI units; n is the number of ticks."""

    summary: dict[str, Any]
    """The content of `summary.json`. Only with `out` it has `estimate`, `picture` and `state_log_sha256`."""
    states: Mapping[str, Array]
    """Columns of the state log by name, each (n,)."""
    estimates: Mapping[str, Array] | None
    """Columns of the estimate's log by name, each (m,). None without `out`, or for a flight on truth."""
    reference: Array
    """(n, 3), m: the load's set-point at each tick, as the scenario gives it."""
    said: tuple[str, ...]
    """Messages of plant and controller, in order."""
    out: Path | None
    """Folder of the logs; None if nothing was written."""

    def table(self) -> Any:
        """Return state log and reference as an Arrow table; `.to_pandas()` makes a data frame."""
        import pyarrow as pa

        columns = {
            **self.states,
            **{f"reference_{a}_m": c for a, c in zip("xyz", self.reference.T, strict=True)},
        }
        return pa.table({name: pa.array(column) for name, column in columns.items()})

    def picture(self, file: str | Path) -> None:
        """Draw the flight into a file, as in `flight.png`."""
        draw(Path(file), dict(self.states), self.reference, self.summary)


def fly(
    scenario: str | Scenario = "setpoint",
    *,
    vehicle: str | Vehicle | None = None,
    overrides: Sequence[str] = (),
    plant_overrides: Sequence[str] = (),
    seed: int = 0,
    design: str = "default",
    law: str | Callable[..., OwnLaw] | None = None,
    agility: float | None = None,
    feedback: str | None = None,
    rate_hz: float = 250.0,
    duration_s: float | None = None,
    out: str | Path | None = None,
    logs: Logs = "usual",
) -> Flight:
    """Fly a scenario in this process, and return when the flight is over.

    Arguments:
        scenario: a shipped name, a .toml file, or a `sitl.flights.scenario.Scenario`.
        vehicle: a shipped name, a .toml file, or a complete `Vehicle`. None: the scenario's.
        overrides: `KEY=VALUE` each, as for `--set`.
        plant_overrides: the same for the plant alone; the controller does not know of them.
        seed: of everything random.
        design: law and gains, as for `--design`.
        law: your own law instead of a design: a class, or its name as for `--law`.
        agility: how fast the load goes to its set-point, from 0 (gentle) to 1 (the vehicle's limits). None:
            the scenario's, or 0.7.
        feedback: what the law flies on, `truth` or `estimate`. None: as for `sitl fly`.
        rate_hz: ticks a second.
        duration_s: simulated seconds. None: the scenario's, or 60.
        out: folder for the files that `sitl fly` writes. None: nothing is written.
        logs: how much is written there: `none` (only the summary), `usual` or `all`.

    Raises DescriptionError if the flight cannot be flown, with a line for each fault. Raises LawError if your
    law fails in flight.
    """
    agility = _checked_agility(agility)
    if isinstance(scenario, str):
        common = [Override(text, "overrides") for text in overrides]
        described = scenario_for(scenario, vehicle, common, agility).scenario
    else:
        described = with_agility(scenario, agility)
    if isinstance(described.reference, GroundControl):
        raise DescriptionError(
            str(scenario), ["ground control takes processes of its own; expected a reference"]
        )
    if described.faults.link:
        raise DescriptionError(str(scenario), ["faults.link takes two processes with a link between them"])
    told, flown = _vehicles(described, vehicle, overrides, plant_overrides)
    check_feasible(described, told, design)
    chosen = None if law is None else choose(law)
    if chosen is not None and design != "default":
        raise DescriptionError("law", [f"instead of a design; leave out design={design!r}"])
    feedback = feedback or usual_feedback(described, told)
    written = None if out is None else Path(out)
    folder = None if logs == "none" else written
    ended = fly_in_process(
        InProcessFlight(
            told=told,
            flown=flown,
            path_from=described.reference.path,
            duration_s=duration_s or described.duration or DEFAULT_DURATION,
            rate_hz=rate_hz,
            seed=seed,
            design=design,
            feedback=feedback,
            faults=checked(described.faults, told),
            law=chosen,
            out=folder,
            logs=logs,
        )
    )
    if ended.law_failure is not None:
        raise ended.law_failure
    path = as_flown(described.reference.path(told.initial_load_position), ended.legs_began_s)
    facts = {
        "scenario": scenario if isinstance(scenario, str) else described.description,
        "vehicle": told.name,
        "design": design if chosen is None else None,
        "law": ended.law,
        "feedback": feedback,
        "seed": seed,
        "clock": "lockstep",
        "rate_hz": rate_hz,
        "launch_to_first_command_s": None,
        "first_command_unix_s": ended.began_at,
        **{key: value for key, value in ended.account.items() if key != "stopped_by"},
    }
    if folder is None:
        states = dict(zip(ended.names, np.asarray(ended.states).T, strict=True))
        summary, estimates = _summary(facts, path, states, told), None
        if written is not None:
            written.mkdir(parents=True, exist_ok=True)
            clear(written)
            write_summary(written, summary)
    else:
        summary, states, estimates = _written(facts, path, folder, told, feedback, logs)
    reference = reference_positions(path, states["time_s"])
    return Flight(summary, states, estimates, reference, tuple(ended.said), written)


def _checked_agility(agility: float | None) -> float | None:
    if agility is not None and not 0.0 <= agility <= 1.0:
        raise DescriptionError("agility", [f"{agility!r}; expected 0 (gentle) to 1 (as fast as it can)"])
    return agility


def _vehicles(
    scenario: Scenario,
    vehicle: str | Vehicle | None,
    overrides: Sequence[str],
    plant_overrides: Sequence[str],
) -> tuple[Vehicle, Vehicle]:
    """As the controller is told, and as the plant simulates."""
    only_plant = [Override(text, "plant_overrides") for text in plant_overrides]
    common = [Override(text, "overrides") for text in overrides]
    told = scenario_vehicle(scenario, vehicle, common)
    if not scenario.plant_set and not only_plant:
        return told, told
    return told, plant_vehicle(scenario, vehicle, [*common, *only_plant])


def _summary(
    facts: dict[str, Any], path: ReferencePath, states: dict[str, Array], told: Vehicle
) -> dict[str, Any]:
    """The figures of a flight that nothing is written of."""
    summary = {**facts, **{key: None for key in PROMISED if key not in facts}, "settled": False}
    if len(states["time_s"]) > 1:
        load = np.stack([states[f"load_{axis}_m"] for axis in "xyz"], axis=1)
        reference = reference_positions(path, states["time_s"])
        seen = sensing_error(told, facts["feedback"], facts["rate_hz"])
        summary |= path_metrics(path, states["time_s"], load, seen)
        summary["settled"] = bool(summary["settled"] and facts["completed"])
        summary |= judge(states, reference, told, summary)._asdict()
    return {key: to_json(value) for key, value in summary.items()}


def _written(
    facts: dict[str, Any], path: ReferencePath, folder: Path, told: Vehicle, feedback: str, logs: Logs
) -> tuple[dict[str, Any], dict[str, Array], dict[str, Array] | None]:
    from controller.feedback.log import ESTIMATE_NAME
    from controller.feedback.truth import estimates
    from sitl.report.keep import keep_recording

    summary = write_report(folder, facts, path, told if estimates(feedback, told) else None, told)
    keep_recording(folder, told, path, logs)
    estimate_log = folder / ESTIMATE_NAME
    found = read_state_log(estimate_log) if estimate_log.exists() else None
    return summary, read_state_log(folder / FILE_NAME), found
