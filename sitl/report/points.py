"""What a flight from point to point came to: pure functions of the state log and the path as it was flown.

The figures of the flight are those at its last point, counted from when that one was set.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypedDict

import numpy as np

from controller.law.reference import Path
from sitl.report.metrics import SAME_INSTANT, Array, flight_metrics, reference_positions


class PointMetrics(TypedDict):
    """What a flight came to at one point, until the next one was set; None where a figure does not exist."""

    position_m: list[float]
    set_at_s: float | None
    """None: the flight was over before."""
    step_m: float
    """From the point before."""
    settling_time_2pct_s: float | None
    settling_time_1cm_s: float | None
    overshoot_pct: float | None
    largest_error_at_end_m: float | None


FROM_METRICS = ("settling_time_2pct_s", "settling_time_1cm_s", "overshoot_pct", "largest_error_at_end_m")


def as_flown(path: Path, legs_began_s: Sequence[float]) -> Path:
    """The path (n,) with the instants, s, at which its legs began; inf for those that did not."""
    out = path.copy()
    out["begin"][1:] = math.inf
    began = legs_began_s[: len(out)]
    out["begin"][: len(began)] = began
    return out


def last_set(path: Path) -> float:
    """When the last set-point that was set at all was set, s; path: (n,), as it was flown."""
    begins = path["begin"]
    return float(begins[np.isfinite(begins)].max())


def path_metrics(path: Path, times: Array, load: Array, sensing_error_m: float = 0.0) -> dict[str, Any]:
    """`flight_metrics` of a path (n,), as it was flown, and `points`, for a sequence.

    A sequence settles at its last point.
    """
    if len(path) == 1:
        return {
            **flight_metrics(times, load, reference_positions(path, times), sensing_error_m),
            "points": None,
        }
    legs = [path[number : number + 1] for number in range(len(path))]
    ends = [*path["begin"][1:].tolist(), math.inf]
    points, last = [], None
    for leg, end in zip(legs, ends, strict=True):
        begin = float(leg["begin"][0])
        here = (times >= begin - SAME_INSTANT) & (times < end - SAME_INSTANT)
        if np.count_nonzero(here) > 1:
            since = np.round(times[here] - begin, 9)
            goal = reference_positions(leg, since)
            last = flight_metrics(since, load[here], goal, sensing_error_m, leg["start"][0])
            points.append(_point(leg, begin, {key: last[key] for key in FROM_METRICS}))  # type: ignore[literal-required]
        else:
            points.append(_point(leg, None, dict.fromkeys(FROM_METRICS)))
    assert last is not None
    settled = last["settled"] and points[-1]["set_at_s"] is not None
    return {**last, "settled": settled, "points": points}


def _point(leg: Path, set_at_s: float | None, figures: dict[str, Any]) -> PointMetrics:
    position, start = leg["centre"][0], leg["start"][0]
    step = float(np.linalg.norm(position - start))
    return {"position_m": position.tolist(), "set_at_s": set_at_s, "step_m": step, **figures}  # type: ignore[typeddict-item]


def unset(points: Sequence[PointMetrics] | None) -> str | None:
    """Why a flight that was over too soon did not settle; None: its last point was set."""
    reached = [point for point in points or () if point["set_at_s"] is not None]
    if points is None or len(reached) == len(points):
        return None
    return f"it was over before point {len(reached) + 1} of {len(points)} was set"
