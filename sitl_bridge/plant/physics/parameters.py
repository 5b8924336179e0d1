"""The vehicle description as one flat record that compiled code reads by name."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.plant.physics.cables.chain import NODE_STATES
from sitl_bridge.plant.physics.cables.flexible_cable import CHAIN, LINEAR, PROGRESSIVE
from sitl_bridge.plant.physics.cables.hoist import HOIST, hoist
from sitl_bridge.plant.physics.ground import contact, leg_reach
from sitl_bridge.plant.physics.state import LEG_BLOCKS, LEG_LANES, MOST_ROTORS
from sitl_bridge.vehicle.cable_law import BRANCH_SPEEDS, BRANCHES, bounce_rate, branches, cable_law
from sitl_bridge.vehicle.chain import chain_rate, end_mass, segment_drag
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.physics import mode_rate

PARAMETERS = np.dtype(
    [
        ("gravity", "f8"),
        ("vehicle_mass", "f8"),
        ("inertia", "f8", 3),
        ("load_mass", "f8"),
        ("stiffness", "f8"),
        ("damping", "f8"),
        ("rest_length", "f8"),  # as it is now: a winch changes it
        ("reel_rate", "f8"),  # m/s, at which the rest length changes
        ("breaking_tension", "f8"),
        ("two_way", "b1"),
        ("cable_kind", "i8"),  # see `flexible_cable`
        ("cable_states", "i8"),  # that it adds to the inner state
        ("curve_scale", "f8"),  # N, of the static curve, see `cable_law`
        ("curve_rate", "f8"),
        ("segments", "i8"),  # of a chain
        ("segment_mass", "f8"),
        ("segment_drag", "f8"),  # N s²/m², across it
        ("branch_weight", "f8", BRANCHES),
        ("branch_rate", "f8", BRANCHES),  # 1/s
        ("has_lag", "b1"),
        ("has_drag", "b1"),
        ("has_ground", "b1"),
        ("has_hoist", "b1"),
        ("hoist", HOIST),
        ("rotor_count", "i8"),
        ("rotor_x", "f8", MOST_ROTORS),
        ("rotor_y", "f8", MOST_ROTORS),
        ("thrust_coefficient", "f8", MOST_ROTORS),
        ("reaction_coefficient", "f8", MOST_ROTORS),
        ("max_speed", "f8", MOST_ROTORS),
        ("time_constant", "f8", MOST_ROTORS),
        ("vehicle_drag", "f8", 2),
        ("load_drag", "f8", 2),
        ("ground_height", "f8"),
        ("contact_chi", "f8"),
        ("leg_count", "i8"),
        ("leg_blocks", "i8"),
        ("leg_reach", "f8"),
        ("leg_x", "f8", (LEG_BLOCKS, LEG_LANES)),
        ("leg_y", "f8", (LEG_BLOCKS, LEG_LANES)),
        ("leg_z", "f8", (LEG_BLOCKS, LEG_LANES)),
        ("leg_stiffness", "f8", (LEG_BLOCKS, LEG_LANES)),
        ("leg_damping", "f8", (LEG_BLOCKS, LEG_LANES)),
        ("leg_friction", "f8"),
        ("load_radius", "f8"),
        ("load_stiffness", "f8"),
        ("load_damping", "f8"),
        ("load_friction", "f8"),
    ],
    align=True,
)

Parameters = NDArray[np.void]


def parameters(vehicle: Vehicle) -> Parameters:
    """A record array of shape (1,) with everything that the equations of motion need, SI units.

    `reaction_coefficient` is c_Q with the sign of the torque about body z (ccw rotors: negative, eq. 13);
    `breaking_tension` is infinite for a cable that does not break. Legs fill whole blocks: those that are not
    there have neither stiffness nor damping.
    """
    record = np.zeros(1, dtype=PARAMETERS)
    p = record[0]
    p["gravity"] = vehicle.gravity
    p["vehicle_mass"] = vehicle.airframe.mass
    p["inertia"] = vehicle.airframe.inertia
    p["load_mass"] = vehicle.load.mass
    p["stiffness"] = vehicle.cable.stiffness
    p["damping"] = vehicle.cable.damping
    p["rest_length"] = vehicle.cable.rest_length
    p["breaking_tension"] = vehicle.cable.breaking_tension or math.inf
    p["has_hoist"] = vehicle.gripper is not None or vehicle.winch is not None
    p["hoist"] = hoist(vehicle)
    p["two_way"] = vehicle.cable.model == "two-way"
    p["cable_kind"] = LINEAR
    if not vehicle.cable.is_linear:
        _fill_progressive(p, vehicle)
    if vehicle.cable.is_chain:
        _fill_chain(p, vehicle)
    p["rotor_count"] = len(vehicle.rotors)
    for index, rotor in enumerate(vehicle.rotors):
        p["rotor_x"][index], p["rotor_y"][index], _ = rotor.position
        p["thrust_coefficient"][index] = rotor.thrust_coefficient
        sign = -1.0 if rotor.direction == "ccw" else 1.0
        p["reaction_coefficient"][index] = sign * rotor.torque_coefficient
        p["max_speed"][index] = rotor.max_speed
        p["time_constant"][index] = rotor.time_constant
    p["has_lag"] = any(rotor.time_constant > 0.0 for rotor in vehicle.rotors)
    for name, drag in (("vehicle_drag", vehicle.airframe.drag), ("load_drag", vehicle.load.drag)):
        p[name] = drag.linear, drag.quadratic
    p["has_drag"] = bool(p["vehicle_drag"].any() or p["load_drag"].any())
    if vehicle.ground is not None:
        _fill_ground(p, vehicle)
    return record


def _fill_progressive(p: np.void, vehicle: Vehicle) -> None:
    law = cable_law(vehicle)
    p["cable_kind"], p["cable_states"] = PROGRESSIVE, BRANCHES
    p["curve_scale"], p["curve_rate"] = law.scale, law.rate
    p["branch_weight"] = branches(law.loss_factor).weights
    p["branch_rate"] = bounce_rate(vehicle, law) * BRANCH_SPEEDS
    p["breaking_tension"] = vehicle.cable.breaking_tension or law.breaking_load


def _fill_chain(p: np.void, vehicle: Vehicle) -> None:
    p["cable_kind"], p["segments"] = CHAIN, vehicle.cable.segments
    p["cable_states"] = NODE_STATES * (vehicle.cable.segments - 1)
    p["segment_mass"] = vehicle.cable_mass / vehicle.cable.segments
    p["segment_drag"] = segment_drag(vehicle)
    p["vehicle_mass"] += end_mass(vehicle)
    p["load_mass"] += end_mass(vehicle)


def _fill_ground(p: np.void, vehicle: Vehicle) -> None:
    ground, legs = vehicle.ground, vehicle.airframe.legs
    assert ground is not None
    p["has_ground"] = True
    p["ground_height"] = ground.height
    p["leg_count"] = len(legs)
    p["leg_blocks"] = math.ceil(len(legs) / LEG_LANES)
    stiffness, p["contact_chi"], damping = contact(ground, vehicle.gravity, vehicle.airframe.mass, len(legs))
    for index, leg in enumerate(legs):
        place = divmod(index, LEG_LANES)
        p["leg_x"][place], p["leg_y"][place], p["leg_z"][place] = leg
        p["leg_stiffness"][place], p["leg_damping"][place] = stiffness, damping
    p["leg_reach"] = leg_reach(legs)
    p["load_stiffness"], _, p["load_damping"] = contact(ground, vehicle.gravity, vehicle.load.mass, 1)
    p["leg_friction"] = ground.friction
    p["load_friction"] = ground.load_friction
    p["load_radius"] = vehicle.load.radius


def fastest_rate(vehicle: Vehicle, lightest_load: float | None = None) -> float:
    """Largest modulus (1/s) of the eigenvalues of cable and ground contact, each on its own.

    lightest_load: kg, where the load is not always as it is described; the ground under it is.

    A mode of stiffness frequency w and damping rate 2 s has s -+ sqrt(s² - w²). The cable between two free
    bodies has w² = k_a / m, s = c_a / 2m, with m the reduced mass. The ground has, for the vehicle's
    turning about body axis i on its legs, w² = sum k (r² - r_i²) / I_i, for heave of either body w² = g /
    sink, and damping in proportion to stiffness.
    """
    load_mass = min(vehicle.load.mass, lightest_load or math.inf)
    reduced = 1.0 / (1.0 / vehicle.airframe.mass + 1.0 / load_mass)
    if vehicle.cable.is_linear:
        modes = [(vehicle.cable.stiffness / reduced, vehicle.cable.damping / reduced)]
    else:
        modes = [(_stiffest(vehicle) / reduced, 0.0)]
    if vehicle.ground is not None:
        stiffness, _, damping = contact(
            vehicle.ground, vehicle.gravity, vehicle.airframe.mass, len(vehicle.airframe.legs)
        )
        heave = vehicle.gravity / vehicle.ground.sink
        squares = [heave * vehicle.load.mass / load_mass]
        for axis, inertia in enumerate(vehicle.airframe.inertia):
            arms = sum(
                sum(part * part for index, part in enumerate(leg) if index != axis)
                for leg in vehicle.airframe.legs
            )
            squares.append(stiffness * arms / inertia)
        modes += [(square, square * damping / stiffness) for square in squares]
    fastest = max(mode_rate(square, double) for square, double in modes)
    return max(fastest, chain_rate(vehicle) * STEP_TIMES_RATE / CHAIN_STEP_TIMES_RATE)


def _stiffest(vehicle: Vehicle) -> float:
    """Largest stiffness, N/m, of a cable of a material before it breaks, all its branches stuck."""
    law = cable_law(vehicle)
    tangent = max(law.tangent(0.0), law.tangent(law.breaking_load))
    return tangent / vehicle.cable.rest_length * (1.0 + float(np.sum(branches(law.loss_factor).weights)))


LONGEST_STEP = 1e-3
"""s; the physics runs at 1 kHz or finer."""
STEP_TIMES_RATE = 0.25
"""Largest step times fastest rate: RK4 is then wrong by 1e-5 a radian, and has a tenfold reserve of
stability."""

CHAIN_STEP_TIMES_RATE = 1.0
"""The same for the modes within a chain: stable up to 2.7, and the fastest are artefacts of the segments."""


def step_count(vehicle: Vehicle, duration: float, lightest_load: float | None = None) -> int:
    """Number of equal steps that `duration` seconds (a tick, a hold) are integrated in.

    lightest_load: kg, as for `fastest_rate`.

    Rule: no step longer than 1 ms, nor than a quarter of the inverse of the vehicle's `fastest_rate`.
    """
    longest = min(LONGEST_STEP, STEP_TIMES_RATE / fastest_rate(vehicle, lightest_load))
    return max(1, math.ceil(duration / longest * (1.0 - 1e-9)))
