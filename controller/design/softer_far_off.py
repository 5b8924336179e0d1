"""Soft gains for a stiff design: what it goes over to far from its reference (`law.schedule`)."""

from __future__ import annotations

import math

import numpy as np

from controller.design.margins import closed_loop_matrix
from controller.design.model import LinearModel
from controller.law.control_law import Design
from controller.law.schedule import GAINS, SIZED
from controller.law.state import EULER_ANGLES, Array

NEAR, FAR = math.radians(25.0), math.radians(60.0)
"""rad, of lean that the stiff law could ask for: from the first one on it is softened, from the second one on
it is the soft one. With 5 N of noise on the load of `paper` it stays below 24 degrees 95 % of the time, on
10 m of cable."""
_LEVEL = [0, 1, 3, 4, 6, 7, 9, 10]
"""Of places and velocities, those on the level: thrust alone takes care of the others."""


def softened(stiff: Design, soft: Design, model: LinearModel) -> Design:
    """The stiff design, made to go over to the soft one where the errors are large; records (1,).

    model: `model.actuated_model`, for which both are stable.
    """
    from scipy import linalg  # here, because a flight whose gains are kept takes no scipy

    out = stiff.copy()
    other = out["soft"][0]
    set_soft(out, soft)
    lean, loop = leaning(stiff), closed_loop_matrix(model, stiff)
    asked = np.zeros((2, len(loop)))
    asked[:, :SIZED] = lean
    energy = linalg.solve_discrete_lyapunov(loop.T, asked.T @ asked)[np.ix_(_LEVEL, _LEVEL)]
    lean = lean[:, _LEVEL]
    # The least multiple of the energy to come that bounds the lean squared.
    scale = float(np.linalg.norm(lean @ np.linalg.solve(energy, lean.T), 2))
    form = np.zeros((SIZED, SIZED))
    form[np.ix_(_LEVEL, _LEVEL)] = scale * energy
    other["form"], other["near"], other["far"] = form, NEAR, FAR
    return out


def set_soft(stiff: Design, soft: Design) -> None:
    """The gains to go over to: an integral gives the same lean and thrust with both, at another rate."""
    other = stiff["soft"][0]
    for name in GAINS.names or ():
        other["gains"][name] = soft[name][0]
    for axis, k in enumerate((2, 1, 0)):  # a lean to x is a pitch, one to y a roll
        of_tilt = 1.0
        if k > 0:
            tilt = EULER_ANGLES.start + k - 1
            of_tilt = float(soft["state_gain"][0, k, tilt] / stiff["state_gain"][0, k, tilt])
        kept = stiff["integral_gain"][0, k] * of_tilt
        other["integral_rate"][axis] = soft["integral_gain"][0, k, axis] / kept[axis]
        other["gains"]["integral_gain"][k] = kept
        other["gains"]["anti_windup"][axis] *= other["integral_rate"][axis]


def at_share(design: Design, share: float) -> Design:
    """The design as it is with a share of its stiff gains; the rate of its integral is in its gain."""
    out, other = design.copy(), design["soft"][0]
    for name in GAINS.names or ():
        out[name] = other["gains"][name] + share * (design[name] - other["gains"][name])
    rate = other["integral_rate"] + share * (1.0 - other["integral_rate"])
    out["integral_gain"] = out["integral_gain"] * rate
    out["anti_windup"] = out["anti_windup"] / rate[..., None]
    out["soft"] = np.zeros(1, dtype=out["soft"].dtype)
    return out


def leaning(design: Design) -> Array:
    """The lean (2, SIZED), rad, about x and y, that places and velocities ask for."""
    gain = design["state_gain"][0]
    return np.array([gain[k, :SIZED] / gain[k, EULER_ANGLES.start + k - 1] for k in (1, 2)])
