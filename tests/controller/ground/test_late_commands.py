"""Under ground control, commands that act later than anybody told: flown, from take-off to landing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.ground.flight import client_requests
from controller.ground.flight.client_requests import Reposition
from controller.ground.flight.px4_modes import Mode
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.ground.flown import Flown
from tests.estimator.guided import GuidedFlight

FOUND = "ticks late: the gains are for that now"
UNTOLD = "loop.delay_ticks=20"
"""80 ms, as of a link that takes 40 ms each way."""
TARGET = (8.0, 5.0)
NAN = math.nan


def up(attitude: np.ndarray) -> float:
    """Cosine of the tilt; attitude: (4,), w, x, y, z."""
    return float(1.0 - 2.0 * (attitude[1] ** 2 + attitude[2] ** 2))


@pytest.mark.parametrize("vehicle", ["iris", "heavy"])
def test_on_truth(vehicle: str) -> None:
    flight = Flown(vehicle=vehicle, untold=(UNTOLD,))
    tilts: list[float] = []
    flight.every_tick = lambda: tilts.append(up(flight.simulation.world.state[6:10]))
    pilot = flight.client()
    flight.take_off(pilot)
    machine = flight.station.machine
    flight.run_until(lambda: machine.mode.name == "HOLD", 60.0)
    height = float(flight.simulation.world.state[2])
    go = Reposition(False, (*TARGET, height), NAN, NAN)
    assert client_requests.reposition(machine, go, True).ok
    flight.run(15.0)
    assert np.linalg.norm(flight.simulation.world.state[13:15] - TARGET) < 0.5
    assert client_requests.set_mode(machine, Mode.LAND, flight.now).ok
    flight.run_until(lambda: not machine.armed, 90.0)
    assert [text for text in flight.said if FOUND in text]
    assert min(tilts) > math.cos(math.radians(50.0))
    assert flight.simulation.world.state[2] < 1.0


def test_on_estimates() -> None:
    told = load_vehicle("iris")
    flight = GuidedFlight(load_vehicle("iris", [UNTOLD]), 1, told=told)
    flight.arm_and_take_off(5.0)
    assert client_requests.reposition(flight.machine, Reposition(False, (*TARGET, NAN), NAN, NAN), True).ok
    flight.wait(12.0)
    vehicle, _ = flight.truth()
    assert np.linalg.norm(vehicle[:2] - TARGET) < 1.0
    assert client_requests.set_mode(flight.machine, Mode.LAND, flight.now).ok
    flight.fly(lambda: not flight.machine.armed, 90.0, "landed and disarmed")
    assert [text for text in flight.said if FOUND in text]
    assert flight.largest_tilt() < math.radians(50.0)
