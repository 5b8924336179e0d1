"""CSV and MATLAB: the state log's own columns, with the reference beside them."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from sitl.recording.recording import REFERENCE_COLUMNS, Columns, Recording


def columns(recording: Recording) -> Columns:
    """State log and reference by name, each (n,), SI units, world ENU and body FLU."""
    reference = dict(zip(REFERENCE_COLUMNS[1:], recording.reference.T, strict=True))
    return {**recording.states, **reference}


def write_csv(recording: Recording, file: Path) -> None:
    """One row a tick, the names in the first; every digit of a double."""
    table = columns(recording)
    with file.open("w", newline="", encoding="utf-8") as out:
        writer = csv.writer(out)
        writer.writerow(table)
        writer.writerows(np.stack(list(table.values()), axis=1).tolist())


def write_mat(recording: Recording, file: Path) -> None:
    """A MATLAB 5 file: structs `states`, and if there are any `estimates` and `terms`; matrix `reference`."""
    from scipy.io import savemat

    variables: dict[str, object] = {
        "states": {name: column[:, None] for name, column in recording.states.items()},
        "reference": recording.reference,
    }
    for name, log in (("estimates", recording.estimates), ("terms", recording.terms)):
        if log is not None:
            variables[name] = {column: values[:, None] for column, values in log.items()}
    savemat(file, variables, long_field_names=True, do_compression=True)
