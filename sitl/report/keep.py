"""What is kept of a flight besides its logs: vehicle, reference, MCAP, interactive report."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from controller.law.reference import Path as ReferencePath
from sitl.export.mcap import FILE_NAME as MCAP_NAME
from sitl.export.mcap import RATES_HZ as MCAP_HZ
from sitl.export.mcap import write_mcap
from sitl.recording.recording import (
    RecordingError,
    read_columns,
    read_recording,
    write_reference,
    write_vehicle,
)
from sitl.report.html_report import FILE_NAME as HTML_NAME
from sitl.report.html_report import write_html
from sitl.report.metrics import reference_positions
from sitl_bridge.log_amount import Logs
from sitl_bridge.plant.log.state_log import FILE_NAME as STATES_NAME
from sitl_bridge.vehicle.description import Vehicle

REFERENCE_EVERY = 5
"""Ticks between two rows of the reference that is kept."""


def keep_recording(
    out: Path, vehicle: Vehicle, path: ReferencePath | None, logs: Logs = "usual", report: bool = True
) -> None:
    """Write what a flight leaves for other tools; nothing where its state log is not complete.

    vehicle: as the controller was told; path: the reference as it was flown, None: ground control's; logs:
    how much; report: whether to make MCAP and page.
    """
    try:
        times = read_columns(out / STATES_NAME)["time_s"]
    except RecordingError:
        return
    if len(times) < 2:
        return
    write_vehicle(out, vehicle)
    kept = np.unique(np.append(times[::REFERENCE_EVERY], times[-1])) if path is not None else np.zeros(0)
    write_reference(out, kept, np.zeros((0, 3)) if path is None else reference_positions(path, kept))
    if not report:
        return
    recording = read_recording(out)
    write_mcap(recording, out / MCAP_NAME, MCAP_HZ[logs])
    write_html(recording, out / HTML_NAME)
