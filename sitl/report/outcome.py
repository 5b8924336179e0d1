"""How a flight ended, in a word, with the time and the cause: from its state log. Pure functions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.report.metrics import SETTLED_WINDOW
from sitl.report.points import unset
from sitl_bridge.vehicle.description import Vehicle

Array = NDArray[np.float64]

TURNED_OVER = math.radians(90.0)
"""Tilt of the vehicle from which on it does not carry any more, rad."""
RUN_AWAY = 100.0
"""m of the load from its set-point; ten times the largest step to one, if that is more."""
CONTACT = 0.02
"""m, by which legs that stand sink in."""


class Outcome(NamedTuple):
    """How a flight ended."""

    outcome: str
    """`settled`, `did not settle`, `turned over`, `hit the ground`, `ran away`, `diverged`, `interrupted`,
    `failed`, or, under ground control, `ended`."""
    outcome_time_s: float | None
    """When, s of the scenario; None where there is no such instant."""
    outcome_cause: str | None
    """Why, in one line; None: there is nothing to add."""


FELL = ("turned over", "hit the ground", "ran away", "diverged")
"""Outcomes of a vehicle that was lost."""
UNKNOWN = Outcome("failed", None, None)


def judge(
    states: Mapping[str, Array], reference: Array | None, vehicle: Vehicle, facts: Mapping[str, Any]
) -> Outcome:
    """The outcome of a flight.

    states: columns of the state log; reference: (n, 3), m, None under ground control, which may land and go
    where it likes; facts: `completed`, `failure`, `settled`, and the metrics.
    """
    lost = _lost(states, reference, vehicle)
    if lost is not None:
        return lost
    failure = facts.get("failure")
    if failure is not None:
        stopped = str(failure).startswith("stopped by")
        return Outcome("interrupted" if stopped else "failed", float(states["time_s"][-1]), str(failure))
    if facts.get("settled"):
        return Outcome("settled", facts.get("settling_time_2pct_s"), None)
    if reference is None:
        return Outcome("ended", float(states["time_s"][-1]), None)
    return Outcome("did not settle", None, _why_unsettled(facts))


def _why_unsettled(facts: Mapping[str, Any]) -> str | None:
    too_soon = unset(facts.get("points"))
    if too_soon is not None:
        return too_soon
    error, allowed = facts.get("largest_error_at_end_m"), facts.get("settled_tolerance_m")
    if error is None or allowed is None:
        return None
    if error > allowed:
        return f"up to {error:.2f} m off at the end, {allowed:.2f} m allowed"
    return f"within {allowed:.2f} m at the end, but not for the last {SETTLED_WINDOW:g} s"


def _lost(states: Mapping[str, Array], reference: Array | None, vehicle: Vehicle) -> Outcome | None:
    """The first thing after which a vehicle is lost; None: it is not."""
    times = states["time_s"]
    found = [
        ("diverged", _first(~np.isfinite(states["vehicle_x_m"] + states["load_x_m"])), "not finite any more"),
        ("turned over", _first(_tilt(states) > TURNED_OVER), "tilted by more than 90 degrees"),
    ]
    if reference is not None:
        found += [
            ("hit the ground", _first(_touches(states, vehicle)), "the vehicle touched the ground in flight"),
            (
                "ran away",
                _first(_far(states, reference)),
                f"the load was over {RUN_AWAY:g} m from its set-point",
            ),
        ]
    happened = [(row, outcome, cause) for outcome, row, cause in found if row is not None]
    if not happened:
        return None
    row, outcome, cause = min(happened)
    return Outcome(outcome, float(times[row]), cause)


def _first(where: NDArray[np.bool_]) -> int | None:
    rows = np.flatnonzero(where)
    return int(rows[0]) if rows.size else None


def _tilt(states: Mapping[str, Array]) -> Array:
    up = 1.0 - 2.0 * (states["attitude_qx"] ** 2 + states["attitude_qy"] ** 2)
    return np.arccos(np.clip(up, -1.0, 1.0))


def _touches(states: Mapping[str, Array], vehicle: Vehicle) -> NDArray[np.bool_]:
    """Where a vehicle that began in the air has its centre no higher than it would stand."""
    height = states["vehicle_z_m"]
    if vehicle.ground is None or vehicle.initial.start == "ground" or not vehicle.airframe.legs:
        return np.zeros(len(height), dtype=bool)
    legs = -min(leg[2] for leg in vehicle.airframe.legs)
    return np.asarray(height < vehicle.ground.height + legs - CONTACT)


def _far(states: Mapping[str, Array], reference: Array) -> NDArray[np.bool_]:
    load = np.stack([states[f"load_{axis}_m"] for axis in "xyz"], axis=1)
    distance = np.linalg.norm(load - reference, axis=1)
    steps = np.linalg.norm(np.diff(reference, axis=0), axis=1)
    largest = max(float(distance[0]), float(steps.max(initial=0.0)))
    return np.asarray(distance > max(RUN_AWAY, 10.0 * largest))
