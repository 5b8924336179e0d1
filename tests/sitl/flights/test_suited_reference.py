"""Shipped paths suit the vehicle that flies them; what somebody has written stays."""

from __future__ import annotations

from pathlib import Path

import pytest

from controller.design.feasibility import path_faults
from sitl.flights.refusals import check_feasible
from sitl.flights.scenario import Circle, FigureEight, Helix, load_scenario, scenario_vehicle
from sitl.flights.suited_reference import scenario_for
from sitl_bridge.vehicle.files import DescriptionError
from sitl_bridge.vehicle.schema import Section

LONG = "cable.rest_length=35.0"


def rate_of(reference: Section) -> float:
    assert isinstance(reference, Circle | FigureEight | Helix)
    return reference.angular_rate


@pytest.mark.parametrize("name", ["circle", "figure-eight", "helix"])
def test_a_vehicle_that_cannot_keep_up_goes_round_more_slowly(name: str) -> None:
    scenario, notes = scenario_for(name, "iris", [LONG])
    own = load_scenario(name)
    assert 0.1 < rate_of(scenario.reference) < rate_of(own.reference)
    assert len(notes) == 1
    assert f"not at {rate_of(own.reference):g}" in notes[0]
    vehicle = scenario_vehicle(scenario, "iris", [LONG])
    path = own.reference.path(vehicle.initial_load_position)  # type: ignore[union-attr]
    assert path_faults(path, vehicle)
    check_feasible(scenario, vehicle, "default")


@pytest.mark.parametrize("vehicle", ["iris", "heavy", "paper", None])
def test_vehicles_that_can_keep_up_fly_it_as_it_is(vehicle: str | None) -> None:
    for name in ("circle", "figure-eight", "helix", "setpoint", "hover", "hold"):
        assert scenario_for(name, vehicle, []) == (load_scenario(name), ())


def test_a_path_that_somebody_has_written_stays_and_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(
        'vehicle = "iris"\n[reference]\nkind = "circle"\n'
        "centre = [0, 0, 5]\nradius = 5.0\nangular_rate = 2.0\n"
    )
    scenario, notes = scenario_for(str(file), "heavy", [])
    assert rate_of(scenario.reference) == 2.0
    assert not notes
    with pytest.raises(DescriptionError, match="expected angular_rate up to"):
        check_feasible(scenario, scenario_vehicle(scenario, "heavy", []), "default")
