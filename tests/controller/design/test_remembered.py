"""What is designed once for equal inputs: to the last bit, the last few, and nobody's change is seen."""

from __future__ import annotations

import numpy as np
import pytest

from controller.design.catalogue import design
from controller.design.motion.ramp import planned
from controller.design.remembered import remembered
from controller.law.reference import setpoint
from sitl_bridge.vehicle.files import load_vehicle


class Counted:
    """A function that counts its calls."""

    def __init__(self) -> None:
        self.calls = 0
        self.remembered = remembered(2)(self._double)

    def _double(self, x: float | np.ndarray, fails: bool = False) -> np.ndarray:
        self.calls += 1
        if fails:
            raise ValueError("no")
        return 2.0 * np.atleast_1d(x)


def test_equal_inputs_are_computed_once_and_others_anew() -> None:
    counted = Counted()
    for x in (1.0, 1.0, np.array([1.0]), np.array([1.0]), -0.0, 0.0):
        assert counted.remembered(x) == 2.0 * np.atleast_1d(x)
    assert counted.calls == 4  # 0.0 is not -0.0, and a number no array


def test_the_oldest_is_forgotten() -> None:
    counted = Counted()
    for x in (1.0, 2.0, 1.0, 3.0, 1.0):
        counted.remembered(x)
    assert counted.calls == 3
    counted.remembered(2.0)
    assert counted.calls == 4


def test_a_caller_may_change_what_it_is_given() -> None:
    counted = Counted()
    counted.remembered(1.0)[0] = 7.0
    counted.remembered(1.0)[0] = 7.0
    assert counted.remembered(1.0)[0] == 2.0
    assert counted.calls == 1


def test_a_failure_is_not_kept() -> None:
    counted = Counted()
    for _ in range(2):
        with pytest.raises(ValueError, match="no"):
            counted.remembered(1.0, fails=True)
    assert counted.calls == 2


def test_designs_and_motions_are_those_that_are_computed_anew() -> None:
    vehicle = load_vehicle("paper")
    path = setpoint((3.0, 5.0, 2.0), (0.0, 0.0, 0.0))
    for _ in range(2):
        assert planned(path, vehicle).tobytes() == planned.__wrapped__(path, vehicle).tobytes()
    heavier = load_vehicle("paper", ["load.mass=11"])
    gains = [design("default", v, 250.0)["state_gain"].tobytes() for v in (vehicle, heavier, vehicle)]
    assert gains[0] == gains[2] != gains[1]
    assert planned(path, heavier).tobytes() != planned(path, vehicle).tobytes()
