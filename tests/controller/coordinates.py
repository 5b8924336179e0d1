"""The state of eq. 31 and the plant's state, one from the other; real or complex, so both differentiate."""

from __future__ import annotations

from typing import Any

import numpy as np

from sitl_bridge.plant.physics import state as plant

Vector = Any  # real or complex


def plant_state(x: Vector) -> Vector:
    """The plant's state (19,) of a state (18,) of eq. 31: quaternion = yaw · pitch · roll."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a / 2), np.sin(a / 2)) for a in x[15:18])
    out = np.zeros(19, dtype=complex)
    out[plant.VEHICLE_POSITION], out[plant.LOAD_POSITION] = x[0:3], x[3:6]
    out[plant.VEHICLE_VELOCITY], out[plant.LOAD_VELOCITY] = x[6:9], x[9:12]
    out[plant.BODY_RATES] = x[12:15]
    out[plant.ATTITUDE] = (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
    return out


def paper_state(x: Vector) -> Vector:
    """The state (18,) of eq. 31 of the plant's state (19,)."""
    w, i, j, k = x[plant.ATTITUDE]
    out = np.zeros(18, dtype=complex)
    out[0:3], out[3:6] = x[plant.VEHICLE_POSITION], x[plant.LOAD_POSITION]
    out[6:9], out[9:12] = x[plant.VEHICLE_VELOCITY], x[plant.LOAD_VELOCITY]
    out[12:15] = x[plant.BODY_RATES]
    out[15] = np.arctan((w * i + j * k) / (0.5 - i * i - j * j))
    out[16] = np.arcsin(2.0 * (w * j - k * i))
    out[17] = np.arctan((w * k + i * j) / (0.5 - j * j - k * k))
    return out
