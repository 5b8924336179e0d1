"""Frames and attitudes as matrices (3, 3), and the errors of attitudes on SO(3).

A frame has its axes as rows, an attitude as columns: it takes components along body axes to the world's.
"""

from __future__ import annotations

import math

from controller.law.state import Array
from sitl_bridge.compiled import kernel

LEAST_COSINE = 1e-6
"""Half the turn's cosine, below which the axis of an error is not told any more."""


@kernel
def dot(a: Array, b: Array) -> float:
    """Scalar product of two vectors (3,)."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@kernel
def cross(a: Array, b: Array, out: Array) -> None:
    """Vector product of two vectors (3,); out is neither of them."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@kernel
def set_frame(heading: Array, upward: Array, frame: Array) -> None:
    """A frame whose z axis is `upward` (3,), its x axis above or below the heading: rows of frame (3, 3)."""
    east, north = upward[0], upward[1]
    x, y, z = heading[0] * east + heading[1] * north, heading[0] * north - heading[1] * east, upward[2]
    in_plane, size = math.sqrt(x * x + z * z), math.sqrt(x * x + y * y + z * z)
    c_pitch, s_pitch, c_roll, s_roll = z / in_plane, x / in_plane, in_plane / size, -y / size
    c_yaw, s_yaw = heading[0], heading[1]
    frame[0, 0], frame[0, 1], frame[0, 2] = c_yaw * c_pitch, s_yaw * c_pitch, -s_pitch
    frame[1, 0] = c_yaw * s_pitch * s_roll - s_yaw * c_roll
    frame[1, 1] = s_yaw * s_pitch * s_roll + c_yaw * c_roll
    frame[1, 2] = c_pitch * s_roll
    frame[2, 0] = c_yaw * s_pitch * c_roll + s_yaw * s_roll
    frame[2, 1] = s_yaw * s_pitch * c_roll - c_yaw * s_roll
    frame[2, 2] = c_pitch * c_roll


@kernel
def into(frame: Array, vector: Array) -> None:
    """A vector (3,) of the world, in a frame."""
    x, y, z = vector[0], vector[1], vector[2]
    for i in range(3):
        vector[i] = frame[i, 0] * x + frame[i, 1] * y + frame[i, 2] * z


@kernel
def out_of(frame: Array, vector: Array) -> None:
    """A vector (3,) of a frame, in the world."""
    x, y, z = vector[0], vector[1], vector[2]
    for i in range(3):
        vector[i] = frame[0, i] * x + frame[1, i] * y + frame[2, i] * z


@kernel
def from_angles(roll: float, pitch: float, yaw: float, out: Array) -> None:
    """R = Rz(yaw)·Ry(pitch)·Rx(roll)."""
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    sy, cy = math.sin(yaw), math.cos(yaw)
    out[0, 0], out[0, 1], out[0, 2] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    out[1, 0], out[1, 1], out[1, 2] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    out[2, 0], out[2, 1], out[2, 2] = -sp, cp * sr, cp * cr


@kernel
def swung(matrix: Array, direction: Array, out: Array) -> None:
    """The attitude turned the shortest way that brings its third axis to a direction (3,), a unit vector.

    Opposite directions have no shortest way: then it stays as it is.
    """
    x, y, z = matrix[0, 2], matrix[1, 2], matrix[2, 2]
    a0, a1, a2 = (
        y * direction[2] - z * direction[1],
        z * direction[0] - x * direction[2],
        x * direction[1] - y * direction[0],
    )
    cosine = x * direction[0] + y * direction[1] + z * direction[2]
    share = 1.0 / (1.0 + cosine) if cosine > LEAST_COSINE - 1.0 else 0.0
    for column in range(3):
        v0, v1, v2 = matrix[0, column], matrix[1, column], matrix[2, column]
        along = (a0 * v0 + a1 * v1 + a2 * v2) * share
        if share == 0.0:
            out[0, column], out[1, column], out[2, column] = v0, v1, v2
        else:  # Rodrigues: v cos + a x v + a (a·v)/(1 + cos)
            out[0, column] = cosine * v0 + a1 * v2 - a2 * v1 + along * a0
            out[1, column] = cosine * v1 + a2 * v0 - a0 * v2 + along * a1
            out[2, column] = cosine * v2 + a0 * v1 - a1 * v0 + along * a2


@kernel
def turn_between(wanted: Array, actual: Array, out: Array) -> None:
    """e_R = (R_c'R - R'R_c)^v / sqrt(1 + tr R_c'R), about the body's axes: 2 sin(angle/2) times the axis.

    To first order the rotation vector from `wanted` to `actual`. Unlike half the numerator it grows up to a
    half turn (Lee 2011).
    """
    trace = 0.0
    for column in range(3):
        for row in range(3):
            trace += wanted[row, column] * actual[row, column]
    scale = 1.0 / max(math.sqrt(max(0.0, 1.0 + trace)), LEAST_COSINE)
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        sine = 0.0  # of R_c'R: [j, i] - [i, j]
        for row in range(3):
            sine += wanted[row, j] * actual[row, i] - wanted[row, i] * actual[row, j]
        out[axis] = scale * sine


@kernel
def seen_from(actual: Array, wanted: Array, vector: Array, out: Array) -> None:
    """A vector (3,) of the wanted body's axes in those of the actual body: R'R_c·vector."""
    for axis in range(3):
        out[axis] = 0.0
        for row in range(3):
            in_world = wanted[row, 0] * vector[0] + wanted[row, 1] * vector[1] + wanted[row, 2] * vector[2]
            out[axis] += actual[row, axis] * in_world
