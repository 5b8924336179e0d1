"""A motion that is planned before the first tick, and flown from where the load then is.

To plan takes a tenth of a second or two. In real time the plant goes on meanwhile: a law that plans at its
first tick has a reference that runs ahead of the load by that time.
"""

from __future__ import annotations

import numpy as np

from controller.design.motion.departure import begins_as_described, departing
from controller.design.motion.ramp import Demand, demand, planned
from controller.law.reference import Path
from controller.law.state import Array
from sitl_bridge.vehicle.cable_law import linearised
from sitl_bridge.vehicle.description import Vehicle

STRETCHES = (1.0, 1.05, 1.1, 1.2, 1.35)
"""Durations over the prepared one that are tried in turn: a longer way, or one in another direction, asks for
more. What fits none of them is planned again."""
SHORTEST_WAY = 0.8
"""Over the prepared way; the prepared duration would be too long for a shorter one."""
MORE_TILT, MORE_THRUST = 1.1, 1.05
"""Over what the prepared motion asks for; the limits of a motion leave more than that to the feedback."""
SLIGHT_TILT = 0.1
"""rad, that is no matter: a motion straight up asks for none."""
_SAMPLES = 300
_GOAL = ("centre", "radius", "angular_rate", "crossing", "climb", "agility", "unhurried", "local")


class PreparedMotion:
    """Plans a reference for a vehicle that is expected to start at a place."""

    def __init__(self, expected: Path, vehicle: Vehicle, estimated: bool) -> None:
        """expected: the reference (1,) from the expected start, not planned yet.

        estimated: it is flown on the estimate.
        """
        self._vehicle, self._estimated, self._described = vehicle, estimated, True
        self._prepared = self._plan(expected)

    def planned(self, path: Path, estimate: Array | None = None) -> Path:
        """The path (1,) as planned beforehand if it starts close to the expected place, else planned now.

        estimate: (18,), eq. 31, as it starts; without one it starts as described.
        """
        if estimate is not None and not begins_as_described(self._vehicle, estimate):
            self._described = False
            if self._prepared["departs"][0]:
                return self._plan(path)
        out = adapted(self._prepared, path, self._vehicle)
        return self._plan(path) if out is None else out

    def _plan(self, path: Path) -> Path:
        out = planned(path, self._vehicle, self._estimated)
        # What an estimator knows at the start is not enough to plan from.
        return departing(out, self._vehicle) if self._described and not self._estimated else out


def adapted(prepared: Path, path: Path, vehicle: Vehicle) -> Path | None:
    """The prepared motion (1,), flown from another path's start; None if it does not suit that path."""
    if any(not np.array_equal(prepared[name], path[name]) for name in _GOAL):
        return None
    out = prepared.copy()
    for name in ("start", "yaw", "yaw_rate"):
        out[name] = path[name]
    if np.array_equal(prepared["start"], path["start"]):
        return out
    if prepared["departs"][0] or prepared["pieces"][0] == 0 or _way(path) < SHORTEST_WAY * _way(prepared):
        return None
    vehicle, duration = linearised(vehicle), float(prepared["ramp_time"][0])
    before = _asked(prepared, vehicle)
    for stretch in STRETCHES:
        out["ramp_time"] = stretch * duration
        if _no_harder(_asked(out, vehicle), before):
            return out
    return None


def _way(path: Path) -> float:
    """m, from its start to its set-point."""
    return float(np.linalg.norm(path["centre"][0] - path["start"][0]))


def _asked(path: Path, vehicle: Vehicle) -> Demand:
    duration = float(path["ramp_time"][0])
    return demand(path, vehicle, duration, np.linspace(0.0, duration, _SAMPLES))


def _no_harder(asked: Demand, before: Demand) -> bool:
    return (
        asked.tilt <= max(MORE_TILT * before.tilt, SLIGHT_TILT)
        and asked.thrust <= MORE_THRUST * before.thrust
        and asked.tension >= 0.5 * before.tension
    )
