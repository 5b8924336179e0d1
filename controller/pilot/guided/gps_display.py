"""The GPS receiver as ground control is shown it: the fixes of HIL_GPS, and their end."""

from __future__ import annotations

import math
from typing import Any

from controller.ground.telemetry.vehicle_state import Gps
from sitl_bridge.frames import (
    CENTIMETRES_PER_METRE,
    DEG_E7_PER_DEG,
    MILLIMETRES_PER_METRE,
    Geodetic,
    enu_to_ned,
)

SILENCE = 1.0
"""s without HIL_GPS, and never less than two of the receiver's intervals, after which there is no fix"""
_NO_FIX, _FIX_2D = 1, 2


class Receiver:
    """Remembers when HIL_GPS was new, for a receiver that is silent says nothing of it."""

    def __init__(self, gps: Any, rate: float) -> None:
        """gps: the record that holds the latest HIL_GPS; rate: of fixes, Hz."""
        self._gps = gps
        self._silence = max(SILENCE, 2.0 / rate)
        self._latest_usec = 0
        self._heard = -math.inf
        self._place: Geodetic | None = None

    def look(self, time: float) -> Gps:
        """What the receiver says at a time of the plant, s."""
        gps = self._gps
        time_usec = int(gps["time_usec"])
        if time_usec != self._latest_usec:
            self._latest_usec, self._heard = time_usec, time
        if not 0.0 <= time - self._heard <= self._silence:  # less than 0: the plant has restarted
            return Gps(fix_type=_NO_FIX if self._latest_usec else 0, position=self._place)
        if gps["fix_type"] < _FIX_2D:
            return Gps(int(gps["fix_type"]), int(gps["satellites_visible"]), position=self._place)
        self._place = Geodetic(
            int(gps["lat"]) / DEG_E7_PER_DEG,
            int(gps["lon"]) / DEG_E7_PER_DEG,
            int(gps["alt"]) / MILLIMETRES_PER_METRE,
        )
        north, east, down = (int(gps[name]) / CENTIMETRES_PER_METRE for name in ("vn", "ve", "vd"))
        return Gps(
            int(gps["fix_type"]),
            int(gps["satellites_visible"]),
            int(gps["eph"]) / CENTIMETRES_PER_METRE,
            int(gps["epv"]) / CENTIMETRES_PER_METRE,
            self._place,
            enu_to_ned((north, east, down)),
        )
