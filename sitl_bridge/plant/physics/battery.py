"""The battery: what voltage and current the rotors draw, and what charge is left.

An ideal source behind a resistance; its voltage falls straight from full to empty with the charge. The drive
takes shaft power over its efficiency, whatever the voltage, as a speed-controlled rotor does. An empty
battery does not stop the rotors: that is for the autopilot to prevent.

Shaft power of a rotor whose disc is known is that of momentum theory in hover over the figure of merit, since
the c_Q of flight-stack models is chosen for yaw and is several times too large for the power.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sitl_bridge.plant.sensors.atmosphere import air_density
from sitl_bridge.vehicle.description import Battery, Vehicle
from sitl_bridge.vehicle.rotors import Rotor

SECONDS_PER_HOUR = 3600.0


class BatteryReading(NamedTuple):
    """What a power module tells."""

    voltage: float
    """V, at the terminals."""
    current: float
    """A, drawn."""
    remaining: float
    """Share of the capacity that is left, 0 to 1."""


def shaft_coefficient(rotor: Rotor, figure_of_merit: float, density: float) -> float:
    """Shaft power over speed cubed, W s³/rad³; density: of the air, kg/m³.

    Momentum theory: a thrust T through a disc A takes at least T^1.5 / sqrt(2 rho A); with T = c_T w².
    """
    if rotor.diameter is None:
        return rotor.torque_coefficient
    disc = 0.25 * math.pi * rotor.diameter**2
    ideal = math.sqrt(rotor.thrust_coefficient**3 / (2.0 * density * disc))
    return ideal / figure_of_merit


def power_coefficients(vehicle: Vehicle, battery: Battery) -> tuple[float, ...]:
    """Electric power of each rotor over its speed cubed, W s³/rad³, in the standard air at home."""
    density = air_density(vehicle.home.altitude)
    return tuple(
        shaft_coefficient(rotor, battery.figure_of_merit, density) / battery.drive_efficiency
        for rotor in vehicle.rotors
    )


def electric_power(battery: Battery, coefficients: Sequence[float], rotor_speed: Sequence[float]) -> float:
    """W that rotors at these speeds (n,) rad/s and the avionics draw."""
    rotors = sum(
        coefficient * abs(speed) ** 3 for coefficient, speed in zip(coefficients, rotor_speed, strict=True)
    )
    return rotors + battery.avionics_power


def reading(battery: Battery, remaining: float, power: float) -> BatteryReading:
    """Terminal voltage and current under a power in W: V I = P with V = V_0 - R I.

    More than the source can give, V_0² / 4R, gets what there is.
    """
    share = max(0.0, remaining)
    empty, full = battery.empty_cell_voltage, battery.full_cell_voltage
    source = battery.cells * (empty + share * (full - empty))
    if battery.resistance == 0.0:
        return BatteryReading(source, power / source, share)
    discriminant = source * source - 4.0 * battery.resistance * power
    # The smaller root, in the form that keeps its digits when R is small.
    current = 2.0 * power / (source + math.sqrt(max(discriminant, 0.0)))
    if discriminant < 0.0:
        current = source / (2.0 * battery.resistance)
    return BatteryReading(source - battery.resistance * current, current, share)


def drained(battery: Battery, remaining: float, current: float, duration: float) -> float:
    """Share of the capacity left after a current (A) for a duration (s)."""
    return max(0.0, remaining - current * duration / (battery.capacity * SECONDS_PER_HOUR))
