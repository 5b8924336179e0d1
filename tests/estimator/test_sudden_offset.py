"""An accelerometer or a gyroscope that is wrong from one sample on: said, taken out, and flown on."""

from __future__ import annotations

from typing import Any

import pytest

import sitl
from sitl.flights.scenario import Scenario
from sitl.report.outcome import FELL
from sitl_bridge.vehicle.files import load_vehicle
from tests.estimator.guided import GuidedFlight


def flight(
    vehicle: str, preset: str, fault: dict[str, Any], kind: str, seed: int, *plant: str
) -> sitl.Flight:
    """A flight in moderate turbulence, with one fault."""
    scenario = Scenario.model_validate(
        {
            "vehicle": "paper",
            "duration": 40.0,
            "reference": {"kind": "setpoint", "position": (3.0, 2.0, 31.0)},
            "faults": {kind: (fault,)},
        }
    )
    return sitl.fly(
        scenario,
        vehicle=vehicle,
        overrides=[f"sensors.preset={preset}", "initial.start=hover", "initial.load_position=[0, 0, 30]"],
        plant_overrides=["air.turbulence.wind_at_6_m=7.7", *plant],
        seed=seed,
        feedback="estimate",
    )


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("sensor", ["accelerometer", "gyroscope"])
@pytest.mark.parametrize(("vehicle", "preset"), [("iris", "consumer"), ("heavy", "rtk"), ("heavy", "urban")])
def test_it_is_said_and_flown_on(vehicle: str, preset: str, sensor: str, seed: int) -> None:
    flown = flight(vehicle, preset, {"sensor": sensor, "failure": "wrong", "at": 12.0}, "sensor", seed)
    assert flown.summary["outcome"] not in FELL
    assert [text for text in flown.said if text.startswith(f"{sensor.capitalize()} wrong by ")]


@pytest.mark.parametrize(
    ("kind", "fault"),
    [
        ("rotor", {"rotor": 1, "thrust": 0.7, "at": 12.0}),
        ("rotor", {"rotor": 1, "thrust": 0.0, "at": 12.0, "duration": 0.1}),
        ("load", {"mass": 1.0, "at": 12.0}),
        ("cable", {"at": 12.0}),
        ("gust", {"start": 12.0, "duration": 0.5, "peak": (8.0, 0.0, 0.0)}),
    ],
    ids=["weak rotor", "rotor off for a moment", "heavier load", "cable snaps", "gust"],
)
def test_what_moves_the_vehicle_is_not_taken_for_the_sensor(kind: str, fault: dict[str, Any]) -> None:
    flown = flight("iris", "consumer", fault, kind, 0)
    assert not [text for text in flown.said if " wrong by " in text]


@pytest.mark.parametrize("preset", ["rtk", "consumer", "urban"])
def test_a_late_rotor_is_not_taken_for_the_sensor(preset: str) -> None:
    """25 ms of rotor lag that nobody is told of, while the load swings."""
    lag = [f"rotors.{rotor}.time_constant=0.05" for rotor in range(4)]
    swing = "initial.load_velocity=[1.5, 1.5, 0.0]"
    fault = {"sensor": "magnetometer", "failure": "off", "at": 12.0}
    flown = flight("iris", preset, fault, "sensor", 0, *lag, swing)
    assert flown.summary["outcome"] not in FELL
    assert not [text for text in flown.said if " wrong by " in text]


@pytest.mark.parametrize("sensor", ["accelerometer", "gyroscope"])
def test_under_ground_control_it_lands(sensor: str) -> None:
    faults = {"sensor": [{"sensor": sensor, "failure": "wrong", "at": 20.0}]}
    guided = GuidedFlight(load_vehicle("iris"), 2, faults)
    guided.arm_and_take_off(5.0)
    guided.fly(lambda: not guided.machine.armed, 60.0, "landed and disarmed")
    assert any(text.startswith(f"{sensor.capitalize()} wrong: landing") for text in guided.said)
