"""The Earth's magnetic field at home: the World Magnetic Model of 2025 (NOAA and BGS), by pygeomag."""

from __future__ import annotations

from functools import lru_cache

from sitl_bridge.frames import Triple
from sitl_bridge.vehicle.description import Home

MODEL = "wmm/WMM_2025.COF"
EPOCH = 2026.5
"""Decimal year that the field is computed for: fixed, so that a run does not depend on the day; the
model holds from 2025 to 2030 and drifts by 0.2 % a year."""


@lru_cache(maxsize=16)
def field_at(home: Home) -> Triple:
    """The field at home, T, ENU. Imports the model on first use: some 10 ms."""
    from pygeomag import GeoMag

    altitude_km = home.altitude / 1000.0
    field = GeoMag(coefficients_file=MODEL).calculate(home.latitude, home.longitude, altitude_km, EPOCH)
    return (field.y * 1e-9, field.x * 1e-9, -field.z * 1e-9)
