"""What the filter reads out of descriptions."""

from types import SimpleNamespace

import numpy as np
import pytest

from controller.estimator.tuning import Tuning, from_sensors, parameters
from tests.estimator.test_accuracy import paper


def suite(density: float) -> SimpleNamespace:
    instrument = SimpleNamespace(noise_density=density, bias=0.02, random_walk=0.0, range=0.0, rate=0.0)
    gps = SimpleNamespace(
        rate=5.0,
        horizontal_noise=0.3,
        vertical_noise=0.8,
        horizontal_velocity_noise=0.1,
        vertical_velocity_noise=0.15,
        horizontal_wander=0.4,
        vertical_wander=0.0,
        wander_time=40.0,
    )
    names = ("accelerometer", "gyroscope", "magnetometer", "barometer")
    return SimpleNamespace(**dict.fromkeys(names, instrument), gps=gps, tracker=None)


def test_noise_density_becomes_the_deviation_of_a_sample() -> None:
    tuning = from_sensors(suite(0.01), 400.0, (0.0, 2e-5, -4e-5), has_ground=False)
    assert tuning.accelerometer_std == pytest.approx(0.2)
    assert tuning.gps_position_std == pytest.approx((0.3, 0.3, 0.8))
    assert (tuning.gps_wander_std, tuning.gps_wander_time) == ((0.4, 0.4, 0.0), 40.0)
    assert tuning.gps_period == pytest.approx(0.2)
    assert not tuning.has_ground


def test_ideal_sensors_have_a_floor() -> None:
    tuning = from_sensors(suite(0.0), 250.0, (0.0, 2e-5, -4e-5))
    stds = (tuning.accelerometer_std, tuning.gyroscope_std, tuning.magnetometer_std, tuning.barometer_std)
    assert min(stds) > 0.0


def test_a_stiff_cable_is_softened_to_what_the_rate_can_follow_and_hangs_as_long() -> None:
    stiff, soft = paper(1.0, "cable.stiffness=1e6"), paper(1.0)
    record = parameters(stiff, 0.004, Tuning())[0]
    assert record["stiffness"] < 1e6
    assert record["substeps"] == 4
    length = record["rest_length"] + 98.1 / record["stiffness"]
    assert length == pytest.approx(stiff.hover_length)
    assert parameters(soft, 0.004, Tuning())[0]["substeps"] == 1


def test_optional_states_are_off_by_default() -> None:
    plain = parameters(paper(1.0), 0.004, Tuning())[0]["initial_std"]
    full = parameters(paper(1.0), 0.004, Tuning(estimate_load_wind=True, estimate_load_mass=True))[0]
    assert np.all(plain[28:32] == 0.0)
    assert np.all(full["initial_std"][28:32] > 0.0)
