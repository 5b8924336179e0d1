"""How stiff the nonlinear law may be: as far as delay margin and rotors' lag leave room.

A stiffer law holds the load nearer to its place against forces that nobody tells it of, and bears less delay.
One number goes from the default weights (0) to the stiffest that are of use (1). For each vehicle, rate and
told delay the largest is taken with which the loop keeps its margin, and the load's velocity is answered so
slowly that the rotors follow: beyond that, long steps and late commands end in a swing, which no linear
margin tells.
"""

from __future__ import annotations

from collections.abc import Callable

from controller.design.margins import closed_loop_matrix, spectral_radius
from controller.design.model import LinearModel
from controller.law.control_law import Design
from controller.law.state import EULER_ANGLES, LOAD_VELOCITY

MARGIN = 0.032
"""s, of extra delay at each input and at all of them, at hover: 20 ms are borne along a fast motion, too."""
LOOKED_AT = (1.0, 0.5, 0.0)
"""Shares of the margin at which the loop has to be stable."""
BETWEEN = (0.5,)
"""Shares of the stiff gains, on the way to soft ones, that are looked at as well."""
FASTEST = 0.14
"""Lags of the rotors in the time constant with which leaning answers the load's velocity, at most."""
HALVINGS = 4
INPUTS = ((0,), (1,), (2,), (3,), (0, 1, 2, 3))


def bears(model: LinearModel, design: Design, margin: float) -> bool:
    """Whether the loop is stable with an extra delay up to a margin (s), at each input and at all of them."""
    return all(
        spectral_radius(closed_loop_matrix(model, design, share * margin, inputs)) < 1.0
        for inputs in INPUTS
        for share in LOOKED_AT
    )


def lag_in_answer(design: Design, gravity: float) -> float:
    """The rotors' lag over the time constant with which the load's velocity is answered by leaning."""
    pitching = design["state_gain"][0][2]
    lean = float(pitching[LOAD_VELOCITY.start] / pitching[EULER_ANGLES.start + 1])  # rad per m/s
    return lean * gravity * float(design["rotor_lag"][0])


def stiffest(good: Callable[[float], bool], most: float) -> float:
    """The largest stiffness from 0 to `most` that is good, within a few halvings; 0 is not asked about."""
    if good(most):
        return most
    low, high = 0.0, most
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if good(middle) else (low, middle)
    return low
