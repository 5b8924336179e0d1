"""How near a load can be held, against a Kalman filter's steady state."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg

from sitl.report.sensing_error import WANDERS, averaged_variance, sensing_error
from sitl_bridge.vehicle.files import load_vehicle
from sitl_bridge.vehicle.sensors import Sensors


def filtered_variance(position_std: float, velocity_std: float, period: float) -> float:
    """Steady-state variance, m², of a position that is measured, and driven by a measured velocity."""
    drive, noise = (velocity_std * period) ** 2, position_std**2
    one = np.eye(1)
    prior = float(linalg.solve_discrete_are(one, one, drive * one, noise * one)[0, 0])
    return prior * noise / (prior + noise)


@pytest.mark.parametrize("preset", ["consumer", "rtk"])
def test_fixes_are_averaged_as_a_kalman_filter_does(preset: str) -> None:
    gps = load_vehicle("iris", [f"sensors.preset={preset}"]).sensors.gps
    variance = 2.0 * filtered_variance(gps.horizontal_noise, gps.horizontal_velocity_noise, 1.0 / gps.rate)
    variance += filtered_variance(gps.vertical_noise, gps.vertical_velocity_noise, 1.0 / gps.rate)
    assert averaged_variance(gps) == pytest.approx(variance, rel=0.3)


def test_a_wander_is_added_whole() -> None:
    wanders = load_vehicle("iris", ["sensors.preset=consumer", "sensors.gps.vertical_wander=2.0"])
    still = load_vehicle("iris", ["sensors.preset=consumer"])
    more = sensing_error(wanders, "estimate", 250.0) - sensing_error(still, "estimate", 250.0)
    assert more == pytest.approx(2.0 * WANDERS, rel=0.01)


def test_a_longer_cable_makes_the_same_angle_a_longer_way() -> None:
    errors = [
        sensing_error(load_vehicle("iris", [f"cable.rest_length={length}"]), "estimate", 250.0)
        for length in (1.5, 5.0, 20.0)
    ]
    assert errors == sorted(errors)
    assert errors[2] > 1.5 * errors[0]


def test_the_truth_has_no_error_and_ideal_sensors_little() -> None:
    assert sensing_error(load_vehicle("iris"), "truth", 250.0) == 0.0
    ideal = load_vehicle("iris").model_copy(update={"sensors": Sensors()})
    assert sensing_error(ideal, "estimate", 250.0) < 0.15
