"""A finished flight, moment by moment: from a flight's folder or from a telemetry log."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sitl.recording.recording import Recording, RecordingError
from sitl.recording.sensors import frames
from sitl.view.listener import Listener
from sitl.view.view import View

FRAME_RATE_HZ = 25.0


def views_of_recording(recording: Recording, rate_hz: float = FRAME_RATE_HZ) -> list[View]:
    """The moments of a flight, so many a second."""
    times, states = recording.times, recording.states
    wanted = np.arange(times[0], times[-1] + 0.5 / rate_hz, 1.0 / rate_hz)
    halfway = 0.5 * (times[1:] + times[:-1])
    rows = np.searchsorted(halfway, wanted)  # the nearest
    vehicle, load = recording.vectors("vehicle_{}_m"), recording.vectors("load_{}_m")
    attitude, controls = recording.vectors("attitude_q{}", "wxyz"), recording.controls()
    tension, nodes = states["cable_tension_N"], recording.nodes()
    return [
        View(
            time_s=float(times[row]),
            vehicle=_triple(vehicle[row]),
            attitude=tuple(attitude[row].tolist()),
            load=_triple(load[row]),
            set_point=_triple(recording.reference[row]) if np.isfinite(recording.reference[row, 0]) else None,
            rotors=tuple(controls[row].tolist()),
            tension=float(tension[row]),
            nodes=tuple(map(_triple, nodes[row])),
        )
        for row in rows.tolist()
    ]


def views_of_tlog(file: Path, rate_hz: float = FRAME_RATE_HZ) -> list[View]:
    """The moments of a telemetry log, so many a second; raises RecordingError for a log without a vehicle."""
    listener = Listener()
    views: list[View] = []
    begin = due = None
    try:
        for time_s, frame in frames(file):
            listener.take(frame, time_s)
            if listener.view.vehicle is None:
                continue
            if due is None or begin is None:
                begin = due = time_s
            if time_s >= due:
                views.append(_at(listener.view, time_s - begin))
                due = max(due + 1.0 / rate_hz, time_s)
    except OSError as error:
        raise RecordingError(f"{file}: {error.strerror}; expected a telemetry log") from None
    if not views:
        raise RecordingError(f"{file}: no vehicle's position in it; expected a telemetry log of a flight")
    return views


def _at(view: View, time_s: float) -> View:
    return replace(view, time_s=time_s)


def _triple(row: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = row.tolist()
    return (x, y, z)
