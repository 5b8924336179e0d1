"""What flies on truth and what on the estimate when nobody says."""

import pytest

from sitl.flights.scenario import load_scenario, plant_vehicle, scenario_vehicle, usual_feedback


@pytest.mark.parametrize(
    ("scenario", "vehicle", "expected"),
    [
        ("setpoint", None, "truth"),
        ("hover", None, "truth"),
        ("circle", "paper", "truth"),
        ("hover", "iris", "estimate"),
        ("setpoint", "heavy", "estimate"),
        ("hold", None, "estimate"),
        ("hold", "paper", "estimate"),
        ("gps-outage", None, "estimate"),
    ],
)
def test_the_papers_scenarios_keep_truth(scenario: str, vehicle: str | None, expected: str) -> None:
    loaded = load_scenario(scenario)
    assert usual_feedback(loaded, scenario_vehicle(loaded, vehicle, [])) == expected


def test_the_autopilot_is_not_told_what_only_the_plant_has() -> None:
    drift = load_scenario("baro-drift")
    told, flown = scenario_vehicle(drift, None, []), plant_vehicle(drift, None, [])
    assert told.sensors.barometer.random_walk == 0.01
    assert flown.sensors.barometer.random_walk == 0.3
