"""A study's changes of the vehicle's own values."""

from __future__ import annotations

import pytest

from sitl.studies.sweep.own_values import of_own
from sitl.studies.sweep.study import Study, Vary
from sitl.studies.sweep.worker import fly_draw
from sitl_bridge.vehicle.files import DescriptionError, load_vehicle

IRIS = load_vehicle("iris")


def test_times_and_plus() -> None:
    tables = IRIS.model_dump()
    assert of_own(tables, "load.mass", 0.5, "times") == {"load.mass": 0.5 * IRIS.load.mass}
    later = of_own(tables, "rotors.*.time_constant", 0.05, "plus")
    assert later == {
        f"rotors.{n}.time_constant": rotor.time_constant + 0.05 for n, rotor in enumerate(IRIS.rotors)
    }
    assert set(of_own(tables, "airframe.inertia.*", 2.0, "times")) == {
        f"airframe.inertia.{n}" for n in range(3)
    }


@pytest.mark.parametrize(
    "key", ["load.weight", "rotors.9.time_constant", "name", "load", "load.mass.x", "air.*.x"]
)
def test_what_is_no_number_of_the_vehicle_is_said(key: str) -> None:
    with pytest.raises(DescriptionError, match="of_own: "):
        of_own(IRIS.model_dump(), key, 1.0, "times")


def test_the_plant_alone_has_the_heavier_load() -> None:
    study = Study(
        name="mine",
        scenario="hover",
        duration=4.0,
        set=("initial.start=hover", "initial.load_position=[0, 0, 5]"),
        vary=(Vary(key="plant.load.mass", low=0.5, high=2.0, of_own="times"),),
        figures=("largest_tension_N",),
    )
    rows = [
        fly_draw(
            study.model_dump(),
            {
                "vehicle": "iris",
                "seed": 0,
                "design": "default",
                "feedback": "truth",
                "plant.load.mass": share,
            },
            None,
        )
        for share in (1.0, 1.2)
    ]
    hanging = IRIS.load.mass * IRIS.gravity
    assert rows[0]["largest_tension_N"] == pytest.approx(hanging, rel=1e-3)
    assert rows[1]["largest_tension_N"] > 1.15 * hanging
