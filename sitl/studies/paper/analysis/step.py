"""V.B: the step to [3, 5, 2] m, and the paper's continuous law that flies it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sitl.studies.paper import independent_simulation as second
from sitl.studies.paper.analysis.linear_model import gains, hover_point
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle

TARGET = (3.0, 5.0, 2.0)
"""m"""


LENGTHS = ("1", "10")
"""l₀, m"""


def vehicle_with(length: str, *more: str) -> Vehicle:
    """The paper's vehicle on a cable of this l₀, m."""
    return load_vehicle("paper", [f"cable.rest_length={length}", *more])


def law(vehicle: Vehicle, reference: Any, **how: Any) -> second.Law:
    """The paper's continuous integral LQR, designed for this vehicle; reference: p_ref at a time."""
    gain, _ = gains(vehicle, integral=True)
    return second.Law(gain, hover_point(vehicle), np.array([vehicle.hover_thrust, 0, 0, 0]), reference, **how)


def around(t: float) -> second.Three:
    """The paper's circle (V.C) at a time, s."""
    return (5.0 * math.sin(t), 5.0 * math.cos(t), 5.0)
