"""Rotors of a description, and what they do together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.vehicle.schema import Arm, Section, quantity


class Rotor(Section):
    position: Arm = quantity("m", "of the hub, body FLU, from the centre of mass")
    direction: Literal["cw", "ccw"] = quantity("-", "seen from above; ccw gives a reaction torque about -z")
    thrust_coefficient: float = quantity("N s²/rad²", "c_T of eq. 5", gt=0, le=1e3)
    torque_coefficient: float = quantity("N m s²/rad²", "c_Q of eq. 12", ge=0, le=1e3)
    max_speed: float = quantity("rad/s", "largest speed, at control 1", gt=0, le=1e5)
    diameter: float | None = quantity(
        "m",
        "of the disc: the battery's drain is momentum theory's; without one, that of c_Q",
        None,
        gt=0,
        le=20,
    )
    time_constant: float = quantity("s", "of the speed's first-order lag; 0: no lag", 0.0, ge=0, le=10)


def rotor_effect(rotors: Sequence[Rotor]) -> NDArray[np.float64]:
    """Thrust and moments about x, y, z (N and N m, body FLU) of a newton of each rotor: (4, n), eq. 13."""
    columns = []
    for rotor in rotors:
        x, y, _ = rotor.position
        sign = -1.0 if rotor.direction == "ccw" else 1.0
        columns.append((1.0, y, -x, sign * rotor.torque_coefficient / rotor.thrust_coefficient))
    return np.array(columns).T


def full_thrust(rotors: Sequence[Rotor]) -> float:
    """N, of all rotors at full speed."""
    return sum(rotor.thrust_coefficient * rotor.max_speed**2 for rotor in rotors)
