"""A flight's folder read back: states, estimate, reference, vehicle description, summary."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.feedback.log import COVARIANCE_NAME, ESTIMATE_NAME
from controller.pilot.terms_log import FILE_NAME as TERMS_NAME
from sitl_bridge.event_log import Event, read_events
from sitl_bridge.mavlink.tlog import FILE_NAME as TLOG_NAME
from sitl_bridge.plant.log.state_log import FILE_NAME as STATES_NAME
from sitl_bridge.vehicle.description import Vehicle

SUMMARY_NAME = "summary.json"
VEHICLE_NAME = "vehicle.json"
"""The description as the controller was told, every default written out."""
REFERENCE_NAME = "reference.parquet"
REFERENCE_COLUMNS = ("time_s", "reference_x_m", "reference_y_m", "reference_z_m")

Array = NDArray[np.float64]
Columns = dict[str, Array]


class RecordingError(ValueError):
    """A folder that is not a finished flight's. One line: the file, and what was expected."""


@dataclass(frozen=True)
class Recording:
    """One flight. World ENU, body FLU, SI units; n rows of the state log."""

    folder: Path
    summary: dict[str, Any]
    vehicle: Vehicle
    states: Columns
    """Columns of the state log, each (n,); see `plant.log.rows.columns`."""
    reference: Array
    """(n, 3), m: where the load was to be at each row, as it was set; NaN under ground control."""
    estimates: Columns | None
    """Columns of the estimate's log on its own rows; None: there is none."""
    covariance: Columns | None = None
    """Likewise of its covariance."""
    terms: Columns | None = None
    """Likewise of what the law's commands were made of; None: its law told none."""
    events: Sequence[Event] = ()
    """What was said and what happened, in order of time."""

    @property
    def times(self) -> Array:
        """(n,), s since the scenario began."""
        return self.states["time_s"]

    @property
    def tlog(self) -> Path | None:
        """The telemetry log, where one was written."""
        file = self.folder / TLOG_NAME
        return file if file.exists() else None

    def vectors(self, pattern: str, letters: Iterable[str] = "xyz") -> Array:
        """Columns (n, k) of the state log whose names differ in one letter: `load_{}_m`."""
        return np.stack([self.states[pattern.format(letter)] for letter in letters], axis=1)

    def nodes(self) -> Array:
        """(n, nodes, 3), m: of a chain, from the top; another cable has none."""
        count = sum(name.startswith("node_") for name in self.states) // 3
        nodes = [self.vectors(f"node_{i + 1}_{{}}_m") for i in range(count)]
        return np.stack(nodes, axis=1) if nodes else np.zeros((len(self.times), 0, 3))

    def controls(self) -> Array:
        """(n, rotors): rotor speeds over the largest."""
        speeds = self.vectors("rotor_{}_rad_s", [str(i + 1) for i in range(len(self.vehicle.rotors))])
        return np.asarray(speeds / np.array([rotor.max_speed for rotor in self.vehicle.rotors]))


def write_vehicle(folder: Path, vehicle: Vehicle) -> None:
    """Keep the description with the flight."""
    text = json.dumps(vehicle.model_dump(mode="json"), indent=1)
    (folder / VEHICLE_NAME).write_text(text + "\n", encoding="utf-8")


def write_reference(folder: Path, times: Array, positions: Array) -> None:
    """Keep the reference: times (n,) in s, positions (n, 3) in m, world; no rows under ground control."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = [pa.array(column) for column in (times, *positions.T)]
    table = pa.table(columns, names=list(REFERENCE_COLUMNS))
    pq.write_table(table, folder / REFERENCE_NAME, compression="zstd")


def read_columns(file: Path) -> Columns:
    """Columns of a Parquet file of numbers; raises RecordingError."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(file)
    except FileNotFoundError:
        raise RecordingError(f"{file}: no such file; expected the folder of a finished flight") from None
    except pa.ArrowInvalid as error:
        raise RecordingError(f"{file} is not complete: {error}") from None
    return {name: np.asarray(table[name].to_numpy(), dtype=np.float64) for name in table.column_names}


def read_recording(folder: Path) -> Recording:
    """Read a flight's folder; raises RecordingError."""
    if not folder.is_dir():
        raise RecordingError(f"{folder}: no such folder; expected one that `sitl fly` has left")
    states = read_columns(folder / STATES_NAME)
    if not len(states["time_s"]):
        raise RecordingError(f"{folder / STATES_NAME}: no rows; the flight never began")
    reference = read_columns(folder / REFERENCE_NAME)
    set_points = np.full((len(states["time_s"]), 3), np.nan)
    if len(reference["time_s"]):
        for column, name in zip(set_points.T, REFERENCE_COLUMNS[1:], strict=True):
            column[:] = np.interp(states["time_s"], reference["time_s"], reference[name])
    logs = (folder / name for name in (ESTIMATE_NAME, COVARIANCE_NAME, TERMS_NAME))
    estimates, covariance, terms = (read_columns(file) if file.exists() else None for file in logs)
    return Recording(
        folder,
        _summary(folder),
        read_vehicle(folder / VEHICLE_NAME),
        states,
        set_points,
        estimates,
        covariance,
        terms,
        read_events(folder),
    )


def _summary(folder: Path) -> dict[str, Any]:
    file = folder / SUMMARY_NAME
    try:
        summary = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RecordingError(f"{file}: {error}; expected a flight's summary") from None
    if not isinstance(summary, dict):
        raise RecordingError(f"{file}: not a JSON object; expected a flight's summary")
    return summary


def read_vehicle(file: Path) -> Vehicle:
    """The description that `write_vehicle` kept; raises RecordingError."""
    try:
        return Vehicle.model_validate_json(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise RecordingError(f"{file}: {reason}; expected the vehicle that flew") from None
