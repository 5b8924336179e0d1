"""Level ground under legs and load: a compliant surface with Coulomb friction that sticks.

Normal force (Hunt and Crossley, 1975): N = k d (1 + chi d'), d the depth; continuous at first touch, never
negative, and dissipative. Friction: each contact is tied by a spring and damper to the point of the ground
where it sticks, its anchor, and carries at most mu N; where the spring alone would carry more, the anchor
slips along. Held anchors mean that what rests, rests: the force of a stuck contact depends on where it is, so
nothing creeps.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sitl_bridge.compiled import kernel, vector_kernel
from sitl_bridge.frames import rotation_matrix
from sitl_bridge.plant.physics.state import ANCHOR_EAST, ANCHOR_NORTH, LEG_LANES, LOAD_CONTACT, Array
from sitl_bridge.vehicle.description import Ground


def contact(ground: Ground, gravity: float, mass: float, points: int) -> tuple[float, float, float]:
    """Of each of a body's contact points: stiffness (N/m), normal chi (s/m), tangential damping (N s/m).

    The body's weight on all its points sinks in by `ground.sink`; small bounces about that depth have
    the frequency sqrt(g / sink) and the damping ratio of the description.
    """
    stiffness = mass * gravity / (points * ground.sink)
    frequency = math.sqrt(gravity / ground.sink)
    chi = 2.0 * ground.damping_ratio * frequency / gravity
    return stiffness, chi, 2.0 * ground.damping_ratio * stiffness / frequency


@kernel
def stuck_force(
    stiffness: Any,
    chi: Any,
    damping: Any,
    depth: Any,
    stretch_x: Any,
    stretch_y: Any,
    vx: Any,
    vy: Any,
    vz: Any,
) -> tuple[Any, Any, Any]:
    """Force of the ground on a contact point that is in the ground and sticks, N, world.

    depth: m, positive in the ground; stretch: m, from its anchor; v: m/s, of the point, world.
    """
    fx = -stiffness * stretch_x - damping * vx
    fy = -stiffness * stretch_y - damping * vy
    return fx, fy, stiffness * depth * (1.0 - chi * vz)


@kernel
def contact_force(friction: Any, depth: Any, fx: Any, fy: Any, normal: Any) -> tuple[Any, Any, Any]:
    """Force of the ground on any contact point, given what it is if the point sticks, N, world.

    None in the air, never a pull, and a friction of at most mu times the normal force.
    """
    if depth <= 0.0 or normal <= 0.0:
        return 0.0, 0.0, 0.0
    most = friction * normal
    squared = fx * fx + fy * fy
    if squared > most * most:
        share = most / math.sqrt(squared)
        fx *= share
        fy *= share
    return fx, fy, normal


@kernel
def stuck_leg(
    p: Any, x: Array, inner: Array, turned: Any, turning: Any, block: int, lane: int
) -> tuple[Any, Any, Any, Any, Any, Any, Any]:
    """Where a leg is, and what the ground does to it if it stands and sticks.

    turned: rotation matrix by rows; turning: rad/s, both of the vehicle, world. Returns arm from the centre
    of mass (x, y, z), m, world; depth in the ground, m; force (x, y, z), N, world.
    """
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = turned
    wx, wy, wz = turning
    bx, by, bz = p.leg_x[block, lane], p.leg_y[block, lane], p.leg_z[block, lane]
    ax = r00 * bx + r01 * by + r02 * bz
    ay = r10 * bx + r11 * by + r12 * bz
    az = r20 * bx + r21 * by + r22 * bz
    number = LEG_LANES * block + lane
    depth = p.ground_height - x[2] - az
    fx, fy, fz = stuck_force(
        p.leg_stiffness[block, lane],
        p.contact_chi,
        p.leg_damping[block, lane],
        depth,
        x[0] + ax - inner[ANCHOR_EAST + number],
        x[1] + ay - inner[ANCHOR_NORTH + number],
        x[3] + wy * az - wz * ay,
        x[4] + wz * ax - wx * az,
        x[5] + wx * ay - wy * ax,
    )
    return ax, ay, az, depth, fx, fy, fz


@kernel
def turning_of(turned: Any, x: Array) -> tuple[Any, Any, Any]:
    """Angular velocity of the vehicle in the world, rad/s; turned: rotation matrix by rows."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = turned
    return (
        r00 * x[10] + r01 * x[11] + r02 * x[12],
        r10 * x[10] + r11 * x[11] + r12 * x[12],
        r20 * x[10] + r21 * x[11] + r22 * x[12],
    )


@kernel
def write_wrench(out: Array, turned: Any, force: Any, moment: Any) -> None:
    """Force (N, world) and moment (N m, turned from the world into the body) into out[0:6]."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = turned
    out[0], out[1], out[2] = force
    mx, my, mz = moment
    out[3] = r00 * mx + r10 * my + r20 * mz
    out[4] = r01 * mx + r11 * my + r21 * mz
    out[5] = r02 * mx + r12 * my + r22 * mz


@vector_kernel
def ground_on_standing(p: Any, x: Array, inner: Array, out: Array) -> int:
    """As `ground_on_vehicle`, if every leg stands and sticks; returns how many do not."""
    turned = rotation_matrix(x[6], x[7], x[8], x[9])
    turning = turning_of(turned, x)
    friction = p.leg_friction
    force_x, force_y, force_z, moment_x, moment_y, moment_z = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    loose = 0
    for block in range(p.leg_blocks):
        for lane in range(LEG_LANES):
            ax, ay, az, depth, fx, fy, fz = stuck_leg(p, x, inner, turned, turning, block, lane)
            most = friction * fz
            # Without branches; a leg that is not there has zeros throughout, and is not loose.
            exists = p.leg_stiffness[block, lane] > 0.0
            loose += (depth <= 0.0) & exists | (fz < 0.0) | (fx * fx + fy * fy > most * most)
            force_x += fx
            force_y += fy
            force_z += fz
            moment_x += ay * fz - az * fy
            moment_y += az * fx - ax * fz
            moment_z += ax * fy - ay * fx
    write_wrench(out, turned, (force_x, force_y, force_z), (moment_x, moment_y, moment_z))
    return loose


@kernel
def ground_on_moving(p: Any, x: Array, inner: Array, out: Array) -> None:
    """As `ground_on_vehicle`, whatever the legs do: in the air, sticking or slipping."""
    turned = rotation_matrix(x[6], x[7], x[8], x[9])
    turning = turning_of(turned, x)
    force_x, force_y, force_z, moment_x, moment_y, moment_z = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(p.leg_count):
        ax, ay, az, depth, fx, fy, fz = stuck_leg(p, x, inner, turned, turning, i // LEG_LANES, i % LEG_LANES)
        fx, fy, fz = contact_force(p.leg_friction, depth, fx, fy, fz)
        force_x += fx
        force_y += fy
        force_z += fz
        moment_x += ay * fz - az * fy
        moment_y += az * fx - ax * fz
        moment_z += ax * fy - ay * fx
    write_wrench(out, turned, (force_x, force_y, force_z), (moment_x, moment_y, moment_z))


@kernel
def ground_on_vehicle(p: Any, x: Array, inner: Array, out: Array) -> None:
    """Force (N, world) and moment (N m, body) of the ground on all legs.

    p: parameter record; x: state; inner: inner state; out: (7,) or more, [0:6] written, and LOOSE set where
    a leg does not both stand and stick.
    """
    if ground_on_standing(p, x, inner, out) > 0:
        ground_on_moving(p, x, inner, out)
        out[LOOSE] = 1.0


LOOSE = 6


@kernel
def ground_on_load(p: Any, x: Array, inner: Array) -> tuple[Any, Any, Any]:
    """Force of the ground on the load, N, world."""
    depth = p.ground_height + p.load_radius - x[15]
    fx, fy, fz = stuck_force(
        p.load_stiffness,
        p.contact_chi,
        p.load_damping,
        depth,
        x[13] - inner[ANCHOR_EAST + LOAD_CONTACT],
        x[14] - inner[ANCHOR_NORTH + LOAD_CONTACT],
        x[16],
        x[17],
        x[18],
    )
    fx, fy, fz = contact_force(p.load_friction, depth, fx, fy, fz)
    return fx, fy, fz


@kernel
def slip(
    stiffness: float,
    chi: float,
    friction: float,
    depth: float,
    rise: float,
    px: float,
    py: float,
    inner: Array,
    number: int,
) -> None:
    """Move one contact's anchor, after a step: under the point when aloft, along with it where it slips.

    depth, rise: m and m/s, of the point; px, py: m, where it is; inner: inner state, written.
    An anchor only ever moves towards its point, so slipping takes energy out of the spring.
    """
    normal = stiffness * depth * (1.0 - chi * rise)
    if depth <= 0.0 or normal <= 0.0:
        inner[ANCHOR_EAST + number], inner[ANCHOR_NORTH + number] = px, py
        return
    sx, sy = px - inner[ANCHOR_EAST + number], py - inner[ANCHOR_NORTH + number]
    squared = sx * sx + sy * sy
    most = friction * depth * (1.0 - chi * rise)
    if squared > most * most:
        share = most / math.sqrt(squared)
        inner[ANCHOR_EAST + number], inner[ANCHOR_NORTH + number] = px - sx * share, py - sy * share


@kernel
def move_anchors(p: Any, x: Array, inner: Array, loose: bool) -> None:
    """Let every contact slip that has to, after a step.

    p: parameter record; x: state; inner: inner state, anchors written; loose: whether a leg slipped or was
    aloft in the step.
    """
    height = x[2] - p.ground_height
    if loose or p.leg_reach <= height < 2.0 * p.leg_reach:  # before the first touch, too
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_matrix(x[6], x[7], x[8], x[9])
        for i in range(p.leg_count):
            block, lane = i // LEG_LANES, i % LEG_LANES
            bx, by, bz = p.leg_x[block, lane], p.leg_y[block, lane], p.leg_z[block, lane]
            ux, uy, uz = x[11] * bz - x[12] * by, x[12] * bx - x[10] * bz, x[10] * by - x[11] * bx
            slip(
                p.leg_stiffness[block, lane],
                p.contact_chi,
                p.leg_friction,
                p.ground_height - x[2] - (r20 * bx + r21 * by + r22 * bz),
                x[5] + (r20 * ux + r21 * uy + r22 * uz),
                x[0] + (r00 * bx + r01 * by + r02 * bz),
                x[1] + (r10 * bx + r11 * by + r12 * bz),
                inner,
                i,
            )
    slip(
        p.load_stiffness,
        p.contact_chi,
        p.load_friction,
        p.ground_height + p.load_radius - x[15],
        x[18],
        x[13],
        x[14],
        inner,
        LOAD_CONTACT,
    )


def leg_reach(legs: tuple[tuple[float, float, float], ...]) -> float:
    """Height of the centre of mass, m, above which no leg touches the ground, whatever the attitude."""
    return max((float(np.linalg.norm(leg)) for leg in legs), default=0.0)
