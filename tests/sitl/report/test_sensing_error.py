"""How near a load can be held, against a Kalman filter's steady state."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import linalg

from sitl.report.sensing_error import STANDARD_DEVIATIONS, WANDERS, sensing_error
from sitl_bridge.vehicle.files import load_vehicle
from sitl_bridge.vehicle.sensors import Sensors


def filtered_variance(position_std: float, velocity_std: float, period: float) -> float:
    """Steady-state variance, m², of a position that is measured, and driven by a measured velocity."""
    drive, noise = (velocity_std * period) ** 2, position_std**2
    one = np.eye(1)
    prior = float(linalg.solve_discrete_are(one, one, drive * one, noise * one)[0, 0])
    return prior * noise / (prior + noise)


@pytest.mark.parametrize("preset", ["consumer", "rtk"])
def test_white_noise_is_averaged_as_a_kalman_filter_does(preset: str) -> None:
    gps = load_vehicle("iris", [f"sensors.preset={preset}"]).sensors.gps
    variance = 2.0 * filtered_variance(gps.horizontal_noise, gps.horizontal_velocity_noise, 1.0 / gps.rate)
    variance += filtered_variance(gps.vertical_noise, gps.vertical_velocity_noise, 1.0 / gps.rate)
    sensors = load_vehicle("iris", [f"sensors.preset={preset}"]).sensors
    assert sensing_error(sensors, "estimate") == pytest.approx(
        STANDARD_DEVIATIONS * math.sqrt(variance), rel=0.15
    )


def test_a_wander_is_added_whole() -> None:
    wanders = load_vehicle("iris", ["sensors.preset=consumer", "sensors.gps.vertical_wander=2.0"]).sensors
    still = load_vehicle("iris", ["sensors.preset=consumer"]).sensors
    more = sensing_error(wanders, "estimate") - sensing_error(still, "estimate")
    assert more == pytest.approx(2.0 * WANDERS)


def test_the_truth_and_ideal_sensors_have_no_error() -> None:
    assert sensing_error(load_vehicle("iris").sensors, "truth") == 0.0
    assert sensing_error(Sensors(), "estimate") == 0.0
