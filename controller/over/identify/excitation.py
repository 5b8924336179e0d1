"""Small sines on body rates and thrust, of frequencies that no two inputs share. Pure functions."""

from __future__ import annotations

import math

import numpy as np

from controller.law.state import Array
from controller.over.law import Setpoint

PERIOD = 10.0
"""s; every frequency is a whole number of periods in this."""
ROLL = (8, 13, 19, 29, 41, 59)
PITCH = (7, 11, 17, 31, 43, 61)
THRUST = (6, 14, 23, 33, 47, 57)
"""Periods in PERIOD, so tenths of a hertz: from below the load's swing to where the lag shows."""
RATE_AMPLITUDE = 0.12
"""rad/s of each sine: at 0.7 Hz a degree and a half of tilt."""
THRUST_AMPLITUDE = 0.025
"""Of hover thrust, of each sine."""
SETTLING = PERIOD
"""s of sines before anything is evaluated."""


def phases(count: int) -> Array:
    """Schroeder's phases (count,), rad, with which the sum of equal sines has no high peaks."""
    k = np.arange(1, count + 1)
    return np.asarray(-math.pi * k * (k - 1) / count)


def sines(numbers: tuple[int, ...], time_s: float) -> float:
    """Sum of sines of amplitude 1 with `numbers` periods in PERIOD."""
    angles = 2.0 * math.pi * np.array(numbers) / PERIOD * time_s + phases(len(numbers))
    return float(np.sin(angles).sum())


def excited(wanted: Setpoint, time_s: float, hover_thrust: float) -> Setpoint:
    """The law's set-point with the sines on top; time_s: since they began; hover_thrust: N."""
    begin = min(1.0, max(0.0, time_s))  # a second to grow in
    roll, pitch, yaw = wanted.rates
    return Setpoint(
        wanted.thrust + begin * THRUST_AMPLITUDE * hover_thrust * sines(THRUST, time_s),
        (
            roll + begin * RATE_AMPLITUDE * sines(ROLL, time_s),
            pitch + begin * RATE_AMPLITUDE * sines(PITCH, time_s),
            yaw,
        ),
    )
