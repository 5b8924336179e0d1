"""Thrust and moments <-> rotor speeds, for any rotor layout."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.law.state import WRENCH_SIZE, Array
from sitl_bridge.compiled import kernel
from sitl_bridge.ids import ACTUATOR_CONTROLS
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.rotors import rotor_effect

MOST_ROTORS = ACTUATOR_CONTROLS

ALLOCATION = np.dtype(
    [
        ("rotor_count", "i8"),
        ("effect", "f8", (WRENCH_SIZE, MOST_ROTORS)),  # wrench per thrust of each rotor (eq. 13)
        ("inverse", "f8", (MOST_ROTORS, WRENCH_SIZE)),  # thrust of each rotor per wrench
        ("largest_thrust", "f8", MOST_ROTORS),  # N
        ("thrust_coefficient", "f8", MOST_ROTORS),  # N s²/rad²
        ("largest_speed", "f8", MOST_ROTORS),  # rad/s
    ]
)

Allocation = NDArray[np.void]


def allocation(vehicle: Vehicle) -> Allocation:
    """The allocation of a vehicle as a record of shape (1,).

    That the rotors can give thrust and all three moments, each with a share in the thrust, is for the
    description to make sure.
    """
    record = np.zeros(1, dtype=ALLOCATION)
    p = record[0]
    p["rotor_count"] = count = len(vehicle.rotors)
    for i, rotor in enumerate(vehicle.rotors):
        p["largest_thrust"][i] = rotor.thrust_coefficient * rotor.max_speed**2
        p["thrust_coefficient"][i] = rotor.thrust_coefficient
        p["largest_speed"][i] = rotor.max_speed
    p["effect"][:, :count] = effect = rotor_effect(vehicle.rotors)
    p["inverse"][:count] = np.linalg.pinv(effect)
    return record


@kernel
def _fitting_span(p: Any, extra: Array) -> float:
    """Largest factor on roll and pitch for which some collective thrust keeps every rotor in its limits."""
    span = 1.0
    for i in range(p.rotor_count):
        for j in range(p.rotor_count):
            # The collective has to lift rotor i off its lower limit and leave rotor j below its upper one.
            need = extra[j] / p.inverse[j, 0] - extra[i] / p.inverse[i, 0]
            room = p.largest_thrust[j] / p.inverse[j, 0]
            if need * span > room:
                span = room / need
    return span


@kernel
def _fitting_share(p: Any, base: Array, extra: Array) -> float:
    """Largest s in 0..1 for which every thrust base + s·extra (N) is within its limits, as base is."""
    share = 1.0
    for i in range(p.rotor_count):
        if extra[i] > 0.0:
            share = min(share, (p.largest_thrust[i] - base[i]) / extra[i])
        elif extra[i] < 0.0:
            share = min(share, -base[i] / extra[i])
    return max(0.0, share)


@kernel
def allocate(p: Any, wrench: Array, controls: Array, achieved: Array, scratch: Array) -> bool:
    """Rotor commands for a wrench; where it does not fit, roll and pitch come first, then thrust, then yaw.

    Each in turn, so that what comes first depends in no way on what comes later: the commands stay a
    continuous function of the wrench, and yaw is never counted on to make room.

    p: allocation record; wrench: (4,), N and N m; controls: (16,), written, 0..1 and proportional to speed;
    achieved: (4,), written, the wrench that the limited rotors give; scratch: (2, 16).
    Returns whether a limit was met.
    """
    base, extra = scratch[0], scratch[1]
    count = p.rotor_count
    # Roll and pitch, with a collective thrust that makes room for them.
    for i in range(count):
        extra[i] = p.inverse[i, 1] * wrench[1] + p.inverse[i, 2] * wrench[2]
    span = _fitting_span(p, extra)
    low, high = 0.0, math.inf
    for i in range(count):
        low = max(low, -span * extra[i] / p.inverse[i, 0])
        high = min(high, (p.largest_thrust[i] - span * extra[i]) / p.inverse[i, 0])
    thrust = min(max(wrench[0], low), max(high, low))
    # Then yaw, as far as there is room left; the limits here only catch rounding.
    for i in range(count):
        base[i] = min(max(p.inverse[i, 0] * thrust + span * extra[i], 0.0), p.largest_thrust[i])
        extra[i] = p.inverse[i, 3] * wrench[3]
    share = _fitting_share(p, base, extra)
    for k in range(WRENCH_SIZE):
        achieved[k] = 0.0
    for i in range(count):
        lift = min(max(base[i] + share * extra[i], 0.0), p.largest_thrust[i])
        controls[i] = math.sqrt(lift / p.thrust_coefficient[i]) / p.largest_speed[i]
        for k in range(WRENCH_SIZE):
            achieved[k] += p.effect[k, i] * lift
    return span < 1.0 or share < 1.0 or thrust != wrench[0]
