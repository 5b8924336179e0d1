"""The battery: what voltage and current the rotors draw, and what charge is left.

An ideal source behind a resistance; its voltage falls straight from full to empty with the charge. The drive
takes shaft power over its efficiency, whatever the voltage, as a speed-controlled rotor does. An empty
battery does not stop the rotors: that is for the autopilot to prevent.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sitl_bridge.vehicle import Battery, Vehicle

SECONDS_PER_HOUR = 3600.0


class BatteryReading(NamedTuple):
    """What a power module tells."""

    voltage: float
    """V, at the terminals."""
    current: float
    """A, drawn."""
    remaining: float
    """Share of the capacity that is left, 0 to 1."""


def electric_power(vehicle: Vehicle, battery: Battery, rotor_speed: Sequence[float]) -> float:
    """W that rotors at these speeds (n,) rad/s and the avionics draw: c_Q w³ on each shaft."""
    shaft = sum(
        rotor.torque_coefficient * abs(speed) ** 3
        for rotor, speed in zip(vehicle.rotors, rotor_speed, strict=True)
    )
    return shaft / battery.drive_efficiency + battery.avionics_power


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
