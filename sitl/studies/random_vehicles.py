"""Valid vehicles of every size, drawn at random: what a law has to fly that nobody has tried it on.

Mass 0.3 to 50 kg, load 5 to 150 % of that, cable from 0.5 m with 0.1 to 60 % of static stretch, 4, 6 or 8
rotors, thrust-to-weight 1.4 to 4, rotor lag 0 to 0.1 s. Sizes follow from the mass as they do for real
multicopters.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import validated

GRAVITY = 9.81
LAGS = (0.0, 0.02, 0.05, 0.1)
"""s, of rotors."""
WIND = 10.0
"""m/s, at which drag is 5 to 45 % of the vehicle's weight, and 2 to 20 % of the load's."""


def _log_uniform(draw: np.random.Generator, low: float, high: float) -> float:
    return float(math.exp(draw.uniform(math.log(low), math.log(high))))


def random_vehicle(draw: np.random.Generator, longest_cable: float = 20.0, drag: bool = False) -> Vehicle:
    """A vehicle from the ranges above; the same generator state gives the same vehicle.

    drag: with drag of vehicle and load, so that wind matters; the rest of the vehicle is the same.
    """
    mass = _log_uniform(draw, 0.3, 50.0)
    load = mass * float(draw.uniform(0.05, 1.5))
    rotors = int(draw.choice((4, 6, 8)))
    arm = 0.22 * mass ** (1.0 / 3.0) * float(draw.uniform(0.8, 1.2))
    inertia = 0.25 * mass * arm * arm * float(draw.uniform(0.6, 1.4))
    length = _log_uniform(draw, 0.5, longest_cable)
    stretch = _log_uniform(draw, 0.001, 0.6) * length
    stiffness = load * GRAVITY / stretch
    reduced = mass * load / (mass + load)
    damping = 2.0 * float(draw.uniform(0.01, 0.3)) * math.sqrt(stiffness * reduced)
    thrust = float(draw.uniform(1.4, 4.0)) * (mass + load) * GRAVITY / rotors
    speed = float(draw.uniform(300.0, 900.0))
    coefficient = thrust / speed**2
    lag = float(draw.choice(LAGS))
    content: dict[str, Any] = {
        "name": "random",
        "airframe": {"mass": mass, "inertia": [inertia, inertia, 1.8 * inertia]},
        "cable": {"rest_length": length, "stiffness": stiffness, "damping": damping},
        "load": {"mass": load},
        "rotors": [
            {
                "position": [arm * math.cos(angle), arm * math.sin(angle), 0.0],
                "direction": "ccw" if index % 2 == 0 else "cw",
                "thrust_coefficient": coefficient,
                "torque_coefficient": 0.06 * coefficient,
                "max_speed": speed,
                "time_constant": lag,
            }
            for index, angle in enumerate(2.0 * math.pi * (k + 0.5) / rotors for k in range(rotors))
        ],
    }
    if drag:
        content["airframe"]["drag"] = {
            "linear": mass * GRAVITY * float(draw.uniform(0.0, 0.2)) / WIND,
            "quadratic": mass * GRAVITY * float(draw.uniform(0.05, 0.25)) / WIND**2,
        }
        content["load"]["drag"] = {"quadratic": load * GRAVITY * float(draw.uniform(0.02, 0.2)) / WIND**2}
    return validated(Vehicle, content, "random")
