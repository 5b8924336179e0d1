"""What a flight came to: pure functions of the state log and the reference."""

from __future__ import annotations

from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from controller.law.reference import Path, path_derivatives

Array = NDArray[np.float64]

STEADY_FROM = 20.0
"""Steady state and tracking are judged from this time on, s; in a shorter flight, over its last third."""
SETTLED_WINDOW = 5.0
"""A flight has settled when its load was near enough all through its last seconds, so many."""
SETTLED_SHARE = 0.02
END_SHARE = 1.0 / 3.0
"""The end of a flight is as long as the window above, but no more than this share of the flight."""
SETTLED_DISTANCE = 0.01  # m, the finer of the two settling times
HOLDING_DISTANCE = 0.3  # m, near enough for a flight without a step


SAME_INSTANT = 1e-6
"""s"""


def reference_positions(path: Path, times: Array) -> Array:
    """The reference (n, 3) in m, world, as it is set, at each of the times (n,).

    path: (1,), or the legs of a sequence as they were flown (`points.as_flown`).
    """
    if len(path) > 1:
        leg = np.searchsorted(path["begin"], times + SAME_INSTANT, side="right") - 1
        return np.asarray(path["centre"][np.maximum(leg, 0)])
    record = path.view(np.recarray)[0]
    derivatives = np.zeros((6, 3))
    if record.radius == 0.0:
        return np.tile(record.centre, (len(times), 1))
    out = np.zeros((len(times), 3))
    for row, t in zip(out, times.tolist(), strict=True):
        path_derivatives(record, t, derivatives)
        row[:] = derivatives[0]
    return out


def settling_time(times: Array, errors: Array, tolerance: float) -> float | None:
    """The last time at which the error leaves the tolerance, s; None when it is outside at the end."""
    outside = np.flatnonzero(errors > tolerance)
    if not outside.size:
        return 0.0
    last = int(outside[-1])
    return None if last + 1 == len(times) else float(times[last + 1])


def overshoot_pct(load: Array, start: Array, target: Array) -> float | None:
    """Overshoot of the worst axis, in percent of that axis' own step; None when no axis has one."""
    worst = None
    for axis in range(3):
        step = target[axis] - start[axis]
        if abs(step) > SETTLED_DISTANCE:
            beyond = float(np.max((load[:, axis] - target[axis]) * np.sign(step)))
            worst = max(worst or 0.0, 100.0 * beyond / float(abs(step)))
    return worst


def steady(times: Array, since: float = 0.0) -> NDArray[np.bool_]:
    """Which of the times (n,), s, belong to the steady part of a flight.

    since: when its last set-point was set, s.
    """
    end = float(times[-1]) - since
    return np.asarray(times >= since + (STEADY_FROM if end > STEADY_FROM else end * 2.0 / 3.0))


class Metrics(TypedDict):
    """What a flight came to; None where a figure does not exist."""

    settled: bool
    settled_tolerance_m: float
    largest_error_at_end_m: float
    settling_time_2pct_s: float | None
    settling_time_1cm_s: float | None
    overshoot_pct: float | None
    steady_state_error_m: float
    tracking_rms_m: float


def flight_metrics(
    times: Array,
    load: Array,
    reference: Array,
    sensing_error_m: float = 0.0,
    start: Array | None = None,
) -> Metrics:
    """Metrics of a flight: times (n,) in s, load (n, 3) and reference (n, 3) in m, world.

    A step is a reference that stands still away from where the load begins: at start (3,), m; None: where
    it is first. sensing_error_m: how far off the sensors may put the load (`sensing_error.sensing_error`);
    nearer than that no flight is asked to stay.
    """
    errors = np.linalg.norm(load - reference, axis=1)
    begin = load[0] if start is None else start
    stands_still = bool(np.all(reference == reference[0]))
    step = float(np.linalg.norm(begin - reference[0])) if stands_still else 0.0
    is_step = step > SETTLED_DISTANCE
    tolerance = max(sensing_error_m, SETTLED_SHARE * step if is_step else HOLDING_DISTANCE)
    end = float(times[-1])
    last = times >= end - SETTLED_WINDOW
    at_end = times >= end - min(SETTLED_WINDOW, END_SHARE * end)
    return {
        "settled": bool(end >= SETTLED_WINDOW and np.all(errors[last] <= tolerance)),
        "settled_tolerance_m": tolerance,
        "largest_error_at_end_m": float(errors[at_end].max()),
        "settling_time_2pct_s": settling_time(times, errors, SETTLED_SHARE * step) if is_step else None,
        "settling_time_1cm_s": settling_time(times, errors, SETTLED_DISTANCE) if stands_still else None,
        "overshoot_pct": overshoot_pct(load, begin, reference[0]) if stands_still else None,
        "steady_state_error_m": float(errors[steady(times)].max()),
        "tracking_rms_m": float(np.sqrt(np.mean(errors[steady(times)] ** 2))),
    }
