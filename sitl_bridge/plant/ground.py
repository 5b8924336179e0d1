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

from sitl_bridge.compiled import kernel
from sitl_bridge.plant.state import FIRST_ANCHOR, LOAD_CONTACT, Array
from sitl_bridge.vehicle import Ground


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
def contact_force(
    stiffness: Any,
    chi: Any,
    damping: Any,
    friction: Any,
    depth: Any,
    stretch_x: Any,
    stretch_y: Any,
    vx: Any,
    vy: Any,
    vz: Any,
) -> tuple[Any, Any, Any]:
    """Force of the ground on one contact point, N, world.

    depth: m, positive in the ground; stretch: m, from its anchor; v: m/s, of the point, world.
    """
    normal = stiffness * depth * (1.0 - chi * vz)
    if depth <= 0.0 or normal <= 0.0:
        return 0.0, 0.0, 0.0
    fx = -stiffness * stretch_x - damping * vx
    fy = -stiffness * stretch_y - damping * vy
    most = friction * normal
    squared = fx * fx + fy * fy
    if squared > most * most:
        share = most / math.sqrt(squared)
        fx *= share
        fy *= share
    return fx, fy, normal


@kernel
def ground_on_vehicle(p: Any, x: Array, inner: Array, out: Array) -> None:
    """Force (N, world) and moment (N m, body) of the ground on all legs.

    p: parameter record; x: state; inner: inner state; out: (6,) or more, [0:6] written.
    """
    qw, qx, qy, qz = x[6], x[7], x[8], x[9]
    r00, r01, r02 = 1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qw * qz), 2 * (qx * qz + qw * qy)
    r10, r11, r12 = 2 * (qx * qy + qw * qz), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qw * qx)
    r20, r21, r22 = 2 * (qx * qz - qw * qy), 2 * (qy * qz + qw * qx), 1 - 2 * (qx * qx + qy * qy)
    # Turning, in the world.
    wx = r00 * x[10] + r01 * x[11] + r02 * x[12]
    wy = r10 * x[10] + r11 * x[11] + r12 * x[12]
    wz = r20 * x[10] + r21 * x[11] + r22 * x[12]
    total_x, total_y, total_z, moment_x, moment_y, moment_z = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(p.leg_count):
        bx, by, bz = p.leg_x[i], p.leg_y[i], p.leg_z[i]
        ax, ay, az = (
            r00 * bx + r01 * by + r02 * bz,
            r10 * bx + r11 * by + r12 * bz,
            r20 * bx + r21 * by + r22 * bz,
        )
        fx, fy, fz = contact_force(
            p.leg_stiffness,
            p.contact_chi,
            p.leg_damping,
            p.leg_friction,
            p.ground_height - x[2] - az,
            x[0] + ax - inner[FIRST_ANCHOR + 2 * i],
            x[1] + ay - inner[FIRST_ANCHOR + 2 * i + 1],
            x[3] + wy * az - wz * ay,
            x[4] + wz * ax - wx * az,
            x[5] + wx * ay - wy * ax,
        )
        total_x += fx
        total_y += fy
        total_z += fz
        moment_x += ay * fz - az * fy
        moment_y += az * fx - ax * fz
        moment_z += ax * fy - ay * fx
    out[0], out[1], out[2] = total_x, total_y, total_z
    out[3] = r00 * moment_x + r10 * moment_y + r20 * moment_z
    out[4] = r01 * moment_x + r11 * moment_y + r21 * moment_z
    out[5] = r02 * moment_x + r12 * moment_y + r22 * moment_z


@kernel
def ground_on_load(p: Any, x: Array, inner: Array) -> tuple[Any, Any, Any]:
    """Force of the ground on the load, N, world."""
    place = FIRST_ANCHOR + 2 * LOAD_CONTACT
    fx, fy, fz = contact_force(
        p.load_stiffness,
        p.contact_chi,
        p.load_damping,
        p.load_friction,
        p.ground_height + p.load_radius - x[15],
        x[13] - inner[place],
        x[14] - inner[place + 1],
        x[16],
        x[17],
        x[18],
    )
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
    anchor: Array,
) -> None:
    """Move one contact's anchor, after a step: under the point when aloft, along with it where it slips.

    depth, rise: m and m/s, of the point; px, py: m, where it is; anchor: (2,), m, world, written.
    An anchor only ever moves towards its point, so slipping takes energy out of the spring.
    """
    normal = stiffness * depth * (1.0 - chi * rise)
    if depth <= 0.0 or normal <= 0.0:
        anchor[0], anchor[1] = px, py
        return
    sx, sy = px - anchor[0], py - anchor[1]
    squared = sx * sx + sy * sy
    most = friction * normal / stiffness
    if squared > most * most:
        share = most / math.sqrt(squared)
        anchor[0], anchor[1] = px - sx * share, py - sy * share


@kernel
def move_anchors(p: Any, x: Array, inner: Array) -> None:
    """Let every contact slip that has to, after a step.

    p: parameter record; x: state; inner: inner state, anchors written.
    """
    if x[2] - p.ground_height < 2.0 * p.leg_reach:  # before the first touch, too
        qw, qx, qy, qz = x[6], x[7], x[8], x[9]
        r00, r01, r02 = 1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qw * qz), 2 * (qx * qz + qw * qy)
        r10, r11, r12 = 2 * (qx * qy + qw * qz), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qw * qx)
        r20, r21, r22 = 2 * (qx * qz - qw * qy), 2 * (qy * qz + qw * qx), 1 - 2 * (qx * qx + qy * qy)
        for i in range(p.leg_count):
            bx, by, bz = p.leg_x[i], p.leg_y[i], p.leg_z[i]
            ux, uy, uz = x[11] * bz - x[12] * by, x[12] * bx - x[10] * bz, x[10] * by - x[11] * bx
            slip(
                p.leg_stiffness,
                p.contact_chi,
                p.leg_friction,
                p.ground_height - x[2] - (r20 * bx + r21 * by + r22 * bz),
                x[5] + (r20 * ux + r21 * uy + r22 * uz),
                x[0] + (r00 * bx + r01 * by + r02 * bz),
                x[1] + (r10 * bx + r11 * by + r12 * bz),
                inner[FIRST_ANCHOR + 2 * i : FIRST_ANCHOR + 2 * i + 2],
            )
    place = FIRST_ANCHOR + 2 * LOAD_CONTACT
    depth = p.ground_height + p.load_radius - x[15]
    slip(
        p.load_stiffness,
        p.contact_chi,
        p.load_friction,
        depth,
        x[18],
        x[13],
        x[14],
        inner[place : place + 2],
    )


def leg_reach(legs: tuple[tuple[float, float, float], ...]) -> float:
    """Height of the centre of mass, m, above which no leg touches the ground, whatever the attitude."""
    return max((float(np.linalg.norm(leg)) for leg in legs), default=0.0)
