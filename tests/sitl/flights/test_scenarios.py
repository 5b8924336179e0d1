"""Scenarios suit the vehicle that flies them: each one flies each shipped vehicle, and one's own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import sitl
from sitl.flights.scenario import (
    GroundControl,
    Points,
    load_scenario,
    plant_vehicle,
    scenario_names,
    scenario_vehicle,
    suited,
)
from sitl_bridge.vehicle import files
from sitl_bridge.vehicle.files import DescriptionError, load_vehicle, vehicle_names

FLOWN = [name for name in scenario_names() if not isinstance(load_scenario(name).reference, GroundControl)]


def test_a_scenarios_cable_is_for_its_own_vehicle() -> None:
    scenario = load_scenario("setpoint")
    assert scenario_vehicle(scenario, None, []).cable.rest_length == 10.0
    assert scenario_vehicle(scenario, "paper", []).cable.rest_length == 10.0
    other = suited(scenario, "heavy")
    assert scenario_vehicle(scenario, "heavy", []).cable == load_vehicle("heavy").cable
    assert "cable.rest_length=10 is for paper only" in other.notes[0]
    assert not suited(scenario, "paper").notes


def test_what_a_scenario_sets_of_its_surroundings_is_for_every_vehicle() -> None:
    scenario = load_scenario("baro-drift")
    assert plant_vehicle(scenario, "heavy", []).sensors.barometer.random_walk == 0.3
    assert scenario_vehicle(scenario, "heavy", []).initial.load_position == (0.0, 0.0, 20.0)


def test_a_vehicle_on_the_ground_starts_in_hover_and_that_is_said() -> None:
    found = suited(load_scenario("setpoint"), "iris")
    vehicle = scenario_vehicle(load_scenario("setpoint"), "iris", [])
    assert vehicle.initial.start == "hover"
    assert vehicle.initial_load_position[2] >= 1.0
    assert any("starts in hover" in note for note in found.notes)


def test_who_asks_for_the_ground_gets_it() -> None:
    overrides = ["initial.start=ground"]
    assert scenario_vehicle(load_scenario("setpoint"), "iris", overrides).initial.start == "ground"
    assert scenario_vehicle(load_scenario("hold"), None, []).initial.start == "ground"


@pytest.mark.parametrize("vehicle", vehicle_names())
@pytest.mark.parametrize("scenario", FLOWN)
def test_every_scenario_flies_every_vehicle(scenario: str, vehicle: str) -> None:
    """Upright, in the air, and within metres of where it is to be."""
    sequence = isinstance(load_scenario(scenario).reference, Points)  # is judged at its last point
    flight = sitl.fly(scenario, vehicle=vehicle, duration_s=None if sequence else 12.0)
    summary, log = flight.summary, flight.states
    assert summary["completed"], flight.said
    upright = 1.0 - 2.0 * (log["attitude_qx"] ** 2 + log["attitude_qy"] ** 2)
    assert np.degrees(np.arccos(upright.min())) < 50.0
    assert summary["largest_error_at_end_m"] < 3.0


def test_paths_in_a_scenario_are_relative_to_it(tmp_path: Path) -> None:
    iris = Path(files.__file__).parents[1] / "vehicles/iris.toml"
    (tmp_path / "sets").mkdir()
    (tmp_path / "mine.toml").write_text(iris.read_text(encoding="utf-8").replace('"iris"', '"mine"'))
    (tmp_path / "sets/gps.toml").write_text('preset = "rtk"\n[gps]\nsatellites = 31\n')
    scenario = tmp_path / "sets/flight.toml"
    scenario.write_text(
        'vehicle = "../mine.toml"\nset = ["sensors.preset=gps.toml"]\n[reference]\nkind = "hover"\n'
    )
    vehicle = scenario_vehicle(load_scenario(str(scenario)), None, [])
    assert vehicle.name == "mine"
    assert vehicle.sensors.gps.satellites == 31


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[reference]\nkind = "setpont"\n', "reference.kind = 'setpont': no such kind; allowed: hover or"),
        ('[reference]\nkind = "setpont"\n', "did you mean setpoint? (line 3)"),
        ("[reference]\n", "reference.kind: missing"),
        (
            '[reference]\nkind = "setpoint"\npositon = [1, 2, 3]\n',
            "did you mean reference.position? (line 4)",
        ),
        ('[reference]\nkind = "hover"\n[faults]\nrotr = 3\n', "faults.rotr = 3: no such key"),
        ('[reference]\nkind = "hover"\n[[faults.rotor]]\nrotor = 1\nat = -1\n', "(line 6)"),
        (
            '[reference]\nkind = "hover"\n[[faults.rotor]]\nrotr = 1\nat = 1\n',
            "did you mean faults.rotor.0.rotor?",
        ),
    ],
)
def test_a_fault_of_a_scenario_has_its_key_and_line(text: str, says: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('vehicle = "iris"\n' + text)
    with pytest.raises(DescriptionError) as caught:
        load_scenario(str(file))
    (line,) = caught.value.faults
    assert says in line
    assert str(caught.value).startswith(f"{file}: ")
