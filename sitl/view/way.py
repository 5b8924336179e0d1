"""The way that a scenario's reference goes, and where it is now."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl.flights.scenario import GroundControl, Scenario
from sitl.report.metrics import reference_positions
from sitl_bridge.frames import Triple
from sitl_bridge.vehicle.description import Vehicle

WAY_POINTS = 200


class Way:
    """Of one scenario and vehicle."""

    def __init__(self, scenario: Scenario, vehicle: Vehicle) -> None:
        reference = scenario.reference
        self._path: Any = None
        """None under ground control, which says itself where to go."""
        if not isinstance(reference, GroundControl):
            self._path = reference.path(vehicle.initial_load_position)

    @property
    def points(self) -> NDArray[np.float64]:
        """(n, 3), m: one round of a circle, figure eight or helix; else the straight line to each point."""
        if self._path is None:
            return np.zeros((0, 3))
        record = self._path[0]
        if record["radius"] == 0.0:
            return np.array([record["start"], *self._path["centre"]])
        period = 2.0 * math.pi / abs(float(record["angular_rate"]))
        return reference_positions(self._path, np.linspace(0.0, period, WAY_POINTS))

    def set_point(self, time_s: float) -> Triple | None:
        """Where the load is to be, m; time_s: since the scenario began. None: it is not known here."""
        if self._path is None or len(self._path) > 1:  # when the next point is set, the autopilot alone knows
            return None
        x, y, z = reference_positions(self._path, np.array([max(0.0, time_s)]))[0].tolist()
        return (x, y, z)
