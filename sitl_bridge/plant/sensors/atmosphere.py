"""Barometer, thermometer, air density: the International Standard Atmosphere (ISO 2533), troposphere."""

from __future__ import annotations

from typing import Any

from sitl_bridge.compiled import kernel
from sitl_bridge.frames import STANDARD_GRAVITY

SEA_LEVEL_PRESSURE = 101325.0  # Pa
SEA_LEVEL_TEMPERATURE = 288.15  # K
LAPSE_RATE = 6.5e-3  # K/m
GAS_CONSTANT = 287.05287  # J/(kg K), of dry air
PRESSURE_EXPONENT = STANDARD_GRAVITY / (GAS_CONSTANT * LAPSE_RATE)
ZERO_CELSIUS = 273.15  # K


@kernel
def air_temperature(altitude: Any) -> Any:
    """K at an altitude in m above mean sea level."""
    return SEA_LEVEL_TEMPERATURE - LAPSE_RATE * altitude


@kernel
def air_pressure(altitude: Any) -> Any:
    """Pa at an altitude in m above mean sea level."""
    return SEA_LEVEL_PRESSURE * (air_temperature(altitude) / SEA_LEVEL_TEMPERATURE) ** PRESSURE_EXPONENT


def air_density(altitude: float) -> float:
    """kg/m³ at an altitude in m above mean sea level."""
    return float(air_pressure(altitude) / (GAS_CONSTANT * air_temperature(altitude)))
