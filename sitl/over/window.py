"""The part of a plant's state log in which the law flew, with times from the take-over. Pure functions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.event_log import EventLog, read_events

Array = NDArray[np.float64]


def cut_log(source: Path, target: Path, begin_s: float, end_s: float) -> bool:
    """Write the rows from `begin_s` to `end_s` (s of the log), counted from `begin_s`; whether there are any.

    Raises ValueError when the log is not complete.
    """
    import pyarrow as pa
    import pyarrow.compute as pc
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(source)
    except pa.ArrowInvalid as error:
        raise ValueError(f"{source} is not complete: {error}") from None
    times = table["time_s"]
    kept = table.filter(pc.and_(pc.greater_equal(times, begin_s), pc.less_equal(times, end_s)))
    if not len(kept):
        return False
    shifted = kept["time_s"].to_numpy() - kept["time_s"][0].as_py()
    kept = kept.set_column(kept.column_names.index("time_s"), "time_s", pa.array(shifted))
    pq.write_table(kept, target, compression="zstd")
    return True


def shift_events(source: Path, target: Path, begin_s: float) -> None:
    """Add the plant's diary to the flight's, with times from `begin_s`; what came before has none."""
    diary = EventLog(target)
    for event in read_events(source):
        late = event.time_s is not None and event.time_s >= begin_s
        diary.add(
            event._replace(time_s=event.time_s - begin_s if late and event.time_s is not None else None)
        )


REST_FROM = 8.0
"""s from which on the residual swing is judged; in a shorter flight, over its last third."""


def swing_deg(vehicle: Array, load: Array) -> Array:
    """(n,): angle of the line from vehicle to load against the vertical, degrees; positions (n, 3)."""
    up = vehicle - load
    return np.asarray(np.degrees(np.arctan2(np.hypot(up[:, 0], up[:, 1]), up[:, 2])))


def step_figures(times: Array, load: Array, vehicle: Array, reference: Array) -> dict[str, Any]:
    """How a flight went: times (n,) in s, positions (n, 3) in m.

    `within_…`: s after which the load stays within a share of the step; null for a reference that moves.
    """
    swing = swing_deg(vehicle, load)
    error = np.linalg.norm(load - reference, axis=1)
    end = float(times[-1])
    rest = times >= (REST_FROM if end > REST_FROM * 1.25 else end * 2.0 / 3.0)
    figures: dict[str, Any] = {
        "largest_swing_deg": float(swing.max()),
        "residual_swing_rms_deg": float(np.sqrt(np.mean(swing[rest] ** 2))),
        "residual_error_rms_m": float(np.sqrt(np.mean(error[rest] ** 2))),
        "within_10pct_s": None,
        "within_5pct_s": None,
        "overshoot_m": None,
    }
    step = reference[-1] - load[0]
    length = float(np.linalg.norm(step))
    if np.all(reference == reference[0]) and length > 0.1:
        for name, share in (("within_10pct_s", 0.1), ("within_5pct_s", 0.05)):
            outside = np.flatnonzero(error > share * length)
            last = int(outside[-1]) + 1 if outside.size else 0
            figures[name] = float(times[last]) if last < len(times) else None
        figures["overshoot_m"] = float(((load - reference) @ (step / length)).max())
    return figures
