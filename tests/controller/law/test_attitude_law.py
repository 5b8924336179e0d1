"""Attitude and rate control as plain Python, against rotations of SciPy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controller.law import attitude_law
from controller.law.allocation import allocation
from controller.law.attitude_law import LARGEST_INTEGRAL, attitude_step, set_limits
from controller.law.control_law import WORK
from controller.law.state import STATE_SIZE, Array
from tests.controller.fleet import FLEET, attributes, delayed

SMALL = FLEET["small"]
UNEQUAL = SMALL.airframe.model_copy(update={"inertia": (0.03, 0.04, 0.055)})
VEHICLE = SMALL.model_copy(update={"airframe": UNEQUAL})
RATE_HZ = 100.0
INERTIA = np.array(VEHICLE.airframe.inertia)
RATES = np.array([0.3, -0.4, 0.5])
EULER = (0.2, -0.3, 0.9)


class Law:
    """A law of attitude gains 4, 3 and 2 1/s, and rates of 2, 3 and 1 rad/s at the most."""

    def __init__(self) -> None:
        record = attitude_law.attitude_law(VEHICLE, RATE_HZ)
        set_limits(record, (4.0, 3.0, 2.0), (2.0, 3.0, 1.0))
        self.law, self.work = attributes(record), attributes(np.zeros(1, dtype=WORK))
        self.law.thrust = VEHICLE.hover_thrust
        self.law.rate[:] = math.nan
        self.controls = np.zeros(16)

    def step(self, euler: Any = EULER, rates: Any = RATES) -> Array:
        """The wrench that it asks for."""
        estimate = np.zeros(STATE_SIZE)
        estimate[12:15], estimate[15:18] = rates, euler
        records: Any = ([self.law], [attributes(allocation(VEHICLE))], [self.work])
        self.limited = attitude_step.python(*records, estimate, self.controls)
        return np.array(self.work.wrench)


def of_rate_error(law: Law, error: Array, rates: Array = RATES) -> Array:
    """Moments for an error of the body rates: PI, and what a turning body takes."""
    gain = np.array(law.law.rate_gain)
    return np.asarray(
        INERTIA * (gain * error + np.array(law.law.integral)) + np.cross(rates, INERTIA * rates)
    )


def test_the_gains_of_a_vehicle() -> None:
    """The rate loop is as slow as rotors and loop ask for, and never faster than 16 1/s."""
    lag = 0.02 + 3 / RATE_HZ
    record = attitude_law.attitude_law(delayed(FLEET["small, lag"], 2), RATE_HZ)
    gain = 1.0 / (2.5 * lag)
    assert record["period"][0] == 1.0 / RATE_HZ
    np.testing.assert_allclose(record["inertia"][0], FLEET["small, lag"].airframe.inertia)
    np.testing.assert_allclose(record["rate_gain"][0], gain)
    np.testing.assert_allclose(record["rate_integral_gain"][0], 1.3 * gain)
    assert record["attitude"][0].tolist() == [1.0, 0.0, 0.0, 0.0]
    assert attitude_law.attitude_law(VEHICLE, 1000.0)["rate_gain"][0].tolist() == [16.0] * 3
    set_limits(record, (1.0, 100.0, 2.0), (1.0, 2.0, 3.0))
    np.testing.assert_allclose(record["attitude_gain"][0], (1.0, gain / 2.0, 2.0))  # what the rate loop bears
    np.testing.assert_allclose(record["largest_rate"][0], (1.0, 2.0, 3.0))


def test_what_is_declared_to_the_compiler_fits_a_law() -> None:
    records = (attitude_law.attitude_law(VEHICLE, RATE_HZ), allocation(VEHICLE), np.zeros(1, WORK))
    arrays = (*records, np.zeros(STATE_SIZE), np.zeros(16))
    assert attitude_step.buffers == len(attitude_step.arguments) == len(arrays)
    for declared, array in zip(attitude_step.arguments, arrays, strict=True):
        assert (np.dtype(declared.dtype), declared.shape) == (array.dtype, array.shape)


def test_rates_alone() -> None:
    law = Law()
    law.law.rate[:] = 0.5, math.nan, -0.1
    law.law.integral[:] = 0.2, -0.3, 0.1
    expected = of_rate_error(law, np.array([0.5 - 0.3, 0.0, -0.1 - 0.5]))
    wrench = law.step()
    assert wrench[0] == VEHICLE.hover_thrust
    np.testing.assert_allclose(wrench[1:], expected)
    assert law.limited == 0


@pytest.mark.parametrize(
    "wanted",
    [EULER, (0.25, -0.3, 0.9), (0.2, -0.2, 0.9), (0.2, -0.3, 1.1), (0.1, -0.4, 0.6), (-0.1, 0.1, 1.2)],
)
def test_tilt_first_then_the_turn_about_the_thrust(wanted: tuple[float, float, float]) -> None:
    law = Law()
    now, then = (Rotation.from_euler("ZYX", e[::-1]) for e in (EULER, wanted))
    law.law.has_attitude, law.law.attitude[:] = 1, then.as_quat(scalar_first=True)
    law.law.rate[:] = 0.05, math.nan, -0.1
    left = now.inv() * then
    axis = left.as_matrix()[:, 2]  # the wanted thrust in the body
    angle = math.atan2(math.hypot(axis[0], axis[1]), axis[2])
    tilt = np.array([-axis[1], axis[0]]) * (angle / max(math.hypot(axis[0], axis[1]), 1e-12))
    w, _, _, z = left.as_quat(scalar_first=True)
    error = np.array([*tilt, 2.0 * math.atan2(z, w)])
    asked = np.array([4.0, 3.0, 2.0]) * error + [0.05, 0.0, -0.1]
    assert (abs(asked) < [2.0, 3.0, 1.0]).all()
    expected = of_rate_error(law, asked - RATES)
    np.testing.assert_allclose(law.step()[1:], expected, atol=1e-9)


def test_rates_that_an_attitude_asks_for_are_limited() -> None:
    for sign in (1.0, -1.0):
        law = Law()
        then = Rotation.from_euler("ZYX", (sign * 2.0, sign * 1.0, sign * 1.0))
        law.law.has_attitude, law.law.attitude[:] = 1, then.as_quat(scalar_first=True)
        law.law.rate[:] = 9.0 * sign
        asked = sign * np.array([2.0, 3.0, 1.0])
        expected = of_rate_error(law, asked - RATES)
        np.testing.assert_allclose(law.step(euler=(0.0, 0.0, 0.0))[1:], expected)


def test_level_and_at_rest_no_moment_is_asked_for() -> None:
    law = Law()
    law.law.has_attitude = 1
    assert law.step(euler=(0.0, 0.0, 0.0), rates=np.zeros(3)).tolist() == [
        VEHICLE.hover_thrust,
        0.0,
        0.0,
        0.0,
    ]


def test_upside_down_it_rolls_back() -> None:
    law = Law()
    law.law.has_attitude = 1
    expected = of_rate_error(law, np.array([2.0, 0.0, 0.0]), np.zeros(3))
    wrench = law.step(euler=(math.pi, 0.0, 0.0), rates=np.zeros(3))
    np.testing.assert_allclose(wrench[1:], expected, atol=1e-6)


def test_the_integral_grows_with_the_error_up_to_its_limit() -> None:
    law = Law()
    law.law.rate[:] = np.add(RATES, (0.02, -0.03, 0.0))
    gain = 1.3 * law.law.rate_gain[0]
    law.step()
    np.testing.assert_allclose(law.law.integral, np.array([0.02, -0.03, 0.0]) * gain / RATE_HZ)
    law.law.integral[:2] = 0.9999 * LARGEST_INTEGRAL, -0.9999 * LARGEST_INTEGRAL
    for _ in range(3):
        law.step()
        assert law.limited == 0
    assert law.law.integral[:2].tolist() == [LARGEST_INTEGRAL, -LARGEST_INTEGRAL]


def test_at_a_rotors_limit_the_integral_stays() -> None:
    law = Law()
    law.law.rate[:] = 50.0
    law.law.integral[:] = 0.2, -0.3, 0.1
    law.step()
    assert law.limited == 1
    assert law.law.integral.tolist() == [0.2, -0.3, 0.1]
