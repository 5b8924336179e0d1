"""Vehicles of many sizes for the tests of the controller."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle

HOVER_SPEED = 500.0  # rad/s


def sized(
    mass: float,
    load: float,
    inertia: tuple[float, float, float],
    rest_length: float,
    stiffness: float,
    damping: float,
    time_constant: float = 0.0,
    drag: tuple[float, float] = (0.0, 0.0),
) -> Vehicle:
    """A cross of four rotors, each good for twice hover thrust.

    Units: kg, kg, kg m², m, N/m, N s/m, s; drag of vehicle and load, linear and quadratic, N s/m and N s²/m².
    """
    thrust_coefficient = (mass + load) * 9.81 / 4.0 / HOVER_SPEED**2
    overrides = [
        f"airframe.mass={mass}",
        f"airframe.inertia={list(inertia)}",
        f"load.mass={load}",
        f"cable.rest_length={rest_length}",
        f"cable.stiffness={stiffness}",
        f"cable.damping={damping}",
    ]
    for of in ("airframe", "load"):
        overrides += [f"{of}.drag.linear={drag[0]}", f"{of}.drag.quadratic={drag[1]}"]
    for rotor in range(4):
        overrides += [
            f"rotors.{rotor}.thrust_coefficient={thrust_coefficient}",
            f"rotors.{rotor}.torque_coefficient={0.05 * thrust_coefficient}",
            f"rotors.{rotor}.max_speed={2**0.5 * HOVER_SPEED}",
            f"rotors.{rotor}.time_constant={time_constant}",
        ]
    return load_vehicle("paper", overrides)


FLEET: dict[str, Vehicle] = {
    "paper": load_vehicle("paper"),
    "paper, 10 m": load_vehicle("paper", ["cable.rest_length=10"]),
    "small": sized(1.5, 0.3, (0.03, 0.03, 0.055), 1.5, 200.0, 0.5),
    "small, lag": sized(1.5, 0.3, (0.03, 0.03, 0.055), 1.5, 60.0, 0.5, time_constant=0.02),
    "small, drag": sized(1.5, 0.3, (0.03, 0.03, 0.055), 1.5, 200.0, 0.5, drag=(0.1, 0.05)),
    "tiny, heavy load": sized(0.5, 0.5, (0.003, 0.003, 0.005), 0.5, 50.0, 0.3),
    "large": sized(15.0, 6.0, (0.6, 0.6, 1.0), 8.0, 500.0, 10.0),
    "large, lag": sized(19.5, 8.0, (1.3, 1.3, 2.3), 8.0, 500.0, 10.0, time_constant=0.06),
    "long": sized(5.0, 10.0, (0.1, 0.1, 0.2), 30.0, 300.0, 5.0),
}


def delayed(vehicle: Vehicle, ticks: int) -> Vehicle:
    """The vehicle with a loop delay that its design knows."""
    return vehicle.model_copy(update={"loop": vehicle.loop.model_copy(update={"delay_ticks": ticks})})


def attributes(record: NDArray[Any]) -> Any:
    """The one record of an array (1,) with its fields as attributes, as compiled code sees it; a view."""
    return record.view(np.recarray)[0]
