"""How much of what a vehicle can do its references may ask for: from gentle to all there is."""

from __future__ import annotations

import math
from typing import NamedTuple

from controller.law.reference import USUAL_AGILITY
from sitl_bridge.vehicle.description import Vehicle

GENTLE_TILT, LARGEST_TILT = math.radians(12.0), math.radians(51.0)
GENTLE_THRUST, LARGEST_THRUST = 0.71, 0.91
"""Of each rotor's at full speed; the rest is left to the feedback."""
GENTLE_SPARE, LEAST_SPARE = 0.88, 0.7
"""Of what a rotor gives beyond hover: the rest is allowed even if a vehicle hovers near full thrust."""
GENTLE_TENSION, LEAST_TENSION = 0.65, 0.15
"""Of the load's weight: the cable stays taut."""
LEAST_THRUST = 0.1
"""Of hover's, of each rotor: rotors that stand do not steer."""

ON_ESTIMATE = 12.0 / 39.0
"""Of the tilt, that is used on the estimate: leaning, the accelerometer tells less about the vertical.

With 25 of 39 degrees `heavy` turned over in 4 of 48 set-points in weather, with 12 in none.
"""


class Limits(NamedTuple):
    """What a reference may ask of vehicle and cable."""

    tilt: float
    """rad, of the vehicle"""
    most_thrust: float
    """Of each rotor's at full speed"""
    least_thrust: float
    """Likewise"""
    tension: float
    """Of the load's weight, the least"""


def limits_of(vehicle: Vehicle, agility: float = USUAL_AGILITY, estimated: bool = False) -> Limits:
    """The limits for an agility between 0, gentle, and 1, all there is; estimated: on the estimate."""

    def between(gentle: float, largest: float) -> float:
        return gentle + agility * (largest - gentle)

    full = sum(rotor.thrust_coefficient * rotor.max_speed**2 for rotor in vehicle.rotors)
    hover = vehicle.hover_thrust / full
    spare = 1.0 - between(GENTLE_SPARE, LEAST_SPARE)
    return Limits(
        between(GENTLE_TILT, LARGEST_TILT) * (ON_ESTIMATE if estimated else 1.0),
        max(between(GENTLE_THRUST, LARGEST_THRUST), hover + spare * (1.0 - hover)),
        LEAST_THRUST * hover,
        between(GENTLE_TENSION, LEAST_TENSION),
    )
