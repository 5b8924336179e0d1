"""A chain: n equal segments between n - 1 nodes with mass and drag, vehicle and load at the ends.

A segment is a spring and damper that never pushes, n times as stiff as the whole cable. Half of its mass is
at each of its ends; the outermost halves move with vehicle and load (`parameters`). The air drags a segment
across its own direction, F = -d |v| v, d for its length. Nodes lie on the ground as a load does: a spring and
damper upwards, friction with a smooth start.

The states of a node are its position and velocity, world; the cable's states are the nodes', from the top.
"""

from __future__ import annotations

import math
from typing import Any

from sitl_bridge.compiled import kernel
from sitl_bridge.plant.physics.state import STATE_SIZE, Array

NODE_STATES = 6
_LOAD = 13
_FOLLOWING = 20.0  # 1/s, with which the nodes of a cable that has let go take their places
_SLIDING = 0.05  # m/s, above which friction on the ground is whole


@kernel
def point(p: Any, index: int) -> int:
    """Where in the extended state the position of an end of a segment is, its velocity three elements on."""
    if index == 0:
        return 0
    if index == p.segments:
        return _LOAD
    return STATE_SIZE + NODE_STATES * (index - 1)


@kernel
def segment_pull(p: Any, length: float, rate: float) -> float:
    """Tension, N, of a segment of this length, m, that grows at this rate, m/s."""
    spring = p.stiffness * (p.segments * length - p.rest_length)
    if spring <= 0.0:
        return 0.0
    return float(max(spring + p.damping * (p.segments * rate - p.reel_rate), 0.0))


@kernel
def segment(p: Any, state: Array, a: int, b: int) -> tuple[float, float, float, float]:
    """Tension of a segment from `point` a to b, N, and its direction."""
    dx, dy, dz = state[b] - state[a], state[b + 1] - state[a + 1], state[b + 2] - state[a + 2]
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    if length <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    ex, ey, ez = dx / length, dy / length, dz / length
    rate = (
        (state[b + 3] - state[a + 3]) * ex
        + (state[b + 4] - state[a + 4]) * ey
        + (state[b + 5] - state[a + 5]) * ez
    )
    return segment_pull(p, length, rate), ex, ey, ez


@kernel
def push(p: Any, index: int, x: float, y: float, z: float, rate: Array, acting: Array) -> None:
    """Add a force to what acts on a point: on a body, or on a node, whose rate holds the force for now."""
    if index == 0:
        acting[0], acting[1], acting[2] = acting[0] + x, acting[1] + y, acting[2] + z
    elif index == p.segments:
        acting[3], acting[4], acting[5] = acting[3] + x, acting[4] + y, acting[5] + z
    else:
        at = point(p, index) + 3
        rate[at], rate[at + 1], rate[at + 2] = rate[at] + x, rate[at + 1] + y, rate[at + 2] + z


@kernel
def follow(p: Any, state: Array, rate: Array) -> None:
    """Nodes of a cable that has let go: on the line between the bodies, should they be joined again."""
    for index in range(1, p.segments):
        at, share = point(p, index), index / p.segments
        for i in range(3):
            place = (1.0 - share) * state[i] + share * state[_LOAD + i]
            speed = (1.0 - share) * state[3 + i] + share * state[_LOAD + 3 + i]
            rate[at + i] = speed + _FOLLOWING * (place - state[at + i])
            rate[at + 3 + i] = _FOLLOWING * (speed - state[at + 3 + i])


@kernel
def chain(p: Any, state: Array, holds: bool, wind: Array, rate: Array, acting: Array) -> None:
    """Add the chain's forces on the bodies to `acting` (6,), and write the nodes' rates.

    state: (19 + 6 (n - 1),) of bodies and nodes; wind: (6,) air velocity at vehicle and load, m/s.
    """
    if not holds:
        follow(p, state, rate)
        return
    for index in range(1, p.segments):
        at = point(p, index)
        for i in range(3):
            rate[at + i], rate[at + 3 + i] = state[at + 3 + i], 0.0
    for index in range(p.segments):
        a, b = point(p, index), point(p, index + 1)
        pull, ex, ey, ez = segment(p, state, a, b)
        push(p, index, pull * ex, pull * ey, pull * ez, rate, acting)
        push(p, index + 1, -pull * ex, -pull * ey, -pull * ez, rate, acting)
        if p.segment_drag > 0.0:
            share = (index + 0.5) / p.segments
            vx = 0.5 * (state[a + 3] + state[b + 3]) - (1.0 - share) * wind[0] - share * wind[3]
            vy = 0.5 * (state[a + 4] + state[b + 4]) - (1.0 - share) * wind[1] - share * wind[4]
            vz = 0.5 * (state[a + 5] + state[b + 5]) - (1.0 - share) * wind[2] - share * wind[5]
            along = vx * ex + vy * ey + vz * ez
            vx, vy, vz = vx - along * ex, vy - along * ey, vz - along * ez
            brake = -0.5 * p.segment_drag * math.sqrt(vx * vx + vy * vy + vz * vz)
            push(p, index, brake * vx, brake * vy, brake * vz, rate, acting)
            push(p, index + 1, brake * vx, brake * vy, brake * vz, rate, acting)
    for index in range(1, p.segments):
        at = point(p, index)
        for i in range(3):
            rate[at + 3 + i] /= p.segment_mass
        rate[at + 5] -= p.gravity
        depth = p.ground_height - state[at + 2]
        if p.has_ground and depth > 0.0:
            stiffness = p.load_stiffness / p.load_mass
            normal = max(stiffness * depth - 1.4 * math.sqrt(stiffness) * state[at + 5], 0.0)
            brake = p.load_friction * normal / max(math.hypot(state[at + 3], state[at + 4]), _SLIDING)
            rate[at + 3] -= brake * state[at + 3]
            rate[at + 4] -= brake * state[at + 4]
            rate[at + 5] += normal


@kernel
def chain_tension(p: Any, x: Array, inner: Array, first: int) -> float:
    """Tension at the vehicle, N. inner[first:]: the first node's position and velocity."""
    top = inner[first : first + NODE_STATES]
    dx, dy, dz = top[0] - x[0], top[1] - x[1], top[2] - x[2]
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    if length <= 0.0:
        return 0.0
    rate = ((top[3] - x[3]) * dx + (top[4] - x[4]) * dy + (top[5] - x[5]) * dz) / length
    return float(segment_pull(p, length, rate))
