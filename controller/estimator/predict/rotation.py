"""Small rotations of compiled code."""

from __future__ import annotations

import math

from controller.estimator.records import X_ATTITUDE, Array
from sitl_bridge.compiled import kernel
from sitl_bridge.frames import Matrix, rotation_matrix


@kernel
def matrix(x: Array) -> Matrix:
    """The rotation matrix body to world, by rows, of the nominal state's attitude."""
    return rotation_matrix(x[X_ATTITUDE], x[X_ATTITUDE + 1], x[X_ATTITUDE + 2], x[X_ATTITUDE + 3])


@kernel
def turn(x: Array, a: float, b: float, c: float) -> None:
    """Turn the nominal attitude by the rotation vector (a, b, c), rad, in body axes."""
    angle2 = a * a + b * b + c * c
    if angle2 > 1e-8:
        angle = math.sqrt(angle2)
        cosine, sine = math.cos(0.5 * angle), math.sin(0.5 * angle) / angle
    else:
        cosine, sine = 1.0 - angle2 / 8.0, 0.5 - angle2 / 48.0
    a, b, c = a * sine, b * sine, c * sine
    w, i, j, k = x[X_ATTITUDE], x[X_ATTITUDE + 1], x[X_ATTITUDE + 2], x[X_ATTITUDE + 3]
    w, i, j, k = (
        w * cosine - i * a - j * b - k * c,
        i * cosine + w * a + j * c - k * b,
        j * cosine + w * b + k * a - i * c,
        k * cosine + w * c + i * b - j * a,
    )
    norm = math.sqrt(w * w + i * i + j * j + k * k)
    x[X_ATTITUDE], x[X_ATTITUDE + 1] = w / norm, i / norm
    x[X_ATTITUDE + 2], x[X_ATTITUDE + 3] = j / norm, k / norm
