"""A cable with states of its own: a chain, or a rope of a material, whose strain relaxes.

The states follow those of the bodies in an extended state, and integrate with them.

A rope's law is that of `vehicle.cable_law`. Its material may be longer than the way from vehicle to load: it
is then slack, and relaxes under no force. Its strain e is the larger of the geometric one and the one without
tension. So the tension is continuous, never negative, and a cycle never gives energy.
"""

from __future__ import annotations

import math
from typing import Any

from sitl_bridge.compiled import kernel
from sitl_bridge.plant.physics.cables.chain import chain
from sitl_bridge.plant.physics.state import STATE_SIZE, Array
from sitl_bridge.vehicle.cable_law import BRANCHES

LINEAR, PROGRESSIVE, CHAIN = 0, 1, 2
"""Kinds of cable: the spring and damper of `cable`, a rope of a material, `chain`."""


@kernel
def static_tension(p: Any, strain: float) -> float:
    """Tension, N, of a relaxed rope; negative where it is shorter than at rest."""
    return float(p.curve_scale * math.expm1(p.curve_rate * strain))


@kernel
def strain_without_tension(p: Any, memory: Array, first: int) -> float:
    """Strain at which the rope pulls no more; memory[first:]: relaxed strains of its branches."""
    pull, whole = 0.0, 1.0
    for i in range(BRANCHES):
        pull += p.branch_weight[i] * static_tension(p, memory[first + i])
        whole += p.branch_weight[i]
    return float(math.log1p(pull / whole / p.curve_scale) / p.curve_rate)


@kernel
def progressive_tension(p: Any, strain: float, memory: Array, first: int) -> float:
    """Tension, N, at a geometric strain; memory[first:]: relaxed strains of the branches."""
    pull = static_tension(p, strain)
    whole = pull
    for i in range(BRANCHES):
        whole += p.branch_weight[i] * (pull - static_tension(p, memory[first + i]))
    return float(max(whole, 0.0))


@kernel
def flexible_cable(
    p: Any, extended: Array, holds: bool, force: Array, wind: Array, rate: Array, acting: Array
) -> None:
    """Forces on the bodies with those of the cable, and the rates of the cable's own states.

    p: parameter record; extended: (19 + n,) state of the bodies, then of the cable; holds: whether it joins
    vehicle and load; force: (6,) external force on vehicle and on load, N, world; wind: (6,) air velocity at
    both, m/s; rate: (19 + n,), of which the cable's part is written; acting: (6,), written.
    """
    for i in range(6):
        acting[i] = force[i]
    if p.cable_kind == CHAIN:
        chain(p, extended, holds, wind, rate, acting)
    else:
        rope(p, extended, holds, rate, acting)


@kernel
def rope(p: Any, extended: Array, holds: bool, rate: Array, acting: Array) -> None:
    """Add a rope's forces on the bodies to `acting`, and write the rates of its relaxed strains."""
    dx, dy, dz = extended[13] - extended[0], extended[14] - extended[1], extended[15] - extended[2]
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    strain = length / p.rest_length - 1.0
    material = strain_without_tension(p, extended, STATE_SIZE)
    if holds and strain > material:
        material = strain
        pull = progressive_tension(p, strain, extended, STATE_SIZE) / length
        acting[0], acting[1], acting[2] = acting[0] + pull * dx, acting[1] + pull * dy, acting[2] + pull * dz
        acting[3], acting[4], acting[5] = acting[3] - pull * dx, acting[4] - pull * dy, acting[5] - pull * dz
    for i in range(BRANCHES):
        rate[STATE_SIZE + i] = (material - extended[STATE_SIZE + i]) * p.branch_rate[i]
