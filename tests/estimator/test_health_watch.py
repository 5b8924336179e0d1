"""What the estimator says of itself: each change once, in words."""

from controller.estimator.filter import Estimator, Health
from controller.feedback.health_notices import HealthWatch, sensors_good
from tests.estimator.test_numerics import hovering


def aged(estimator: Estimator, **ages: float) -> Health:
    health = estimator.health()
    sensors = {name: sensor._replace(age=ages.get(name, 0.0)) for name, sensor in health.sensors.items()}
    return health._replace(sensors=sensors)


def test_each_change_is_said_once() -> None:
    estimator = hovering(10)
    watch = HealthWatch(tracker_fitted=False)
    assert watch.changes(aged(estimator)) == []
    lost = aged(estimator, magnetometer=2.1)
    assert watch.changes(lost) == ["Magnetometer lost: the heading drifts"]
    assert watch.changes(lost) == []
    assert watch.changes(aged(estimator)) == ["Magnetometer is back"]


def test_gps_is_there_as_long_as_one_half_of_it_is_used() -> None:
    estimator = hovering(10)
    assert sensors_good(aged(estimator, gps_position=30.0))["gps"]
    assert not sensors_good(aged(estimator, gps_position=30.0, gps_velocity=30.0))["gps"]
    refused = aged(estimator, gps_position=30.0)._replace(gps_refused=True)
    assert HealthWatch(False).changes(refused) == ["GPS refused: it contradicts everything else"]


def test_a_tracker_that_is_not_fitted_is_not_missed() -> None:
    lost = aged(hovering(10), tracker=60.0)
    assert HealthWatch(False).changes(lost) == []
    assert HealthWatch(True).changes(lost) == ["Load tracker lost: the accelerometer shows the load"]
