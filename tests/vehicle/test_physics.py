"""What no body, cable or start can be is refused, all of it at once, and what would do is said."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sitl_bridge.vehicle.errors import DescriptionError
from sitl_bridge.vehicle.files import load_vehicle, vehicle_names

HOVER = "initial.start=hover"


def faults(*overrides: str, source: str = "iris") -> list[str]:
    with pytest.raises(DescriptionError) as caught:
        load_vehicle(source, overrides)
    return caught.value.faults


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        (["airframe.inertia=[0.03, 0.03, 0.5]"], "airframe.inertia.2 = 0.5 kg m²: more than the other two"),
        (["airframe.inertia=[1e-12, 1e-12, 1e-12]"], "airframe.inertia = "),
        (["cable.breaking_tension=2"], "cable.breaking_tension = 2 N: the load weighs 2.943 N"),
        (["cable.stiffness=1e-3"], "cable.stiffness = 0.001 N/m: the load stretches the cable by"),
        (["cable.stiffness=1e6", "load.mass=1e-3"], "cable.stiffness = 1e+06 N/m: vehicle and load move"),
        (["cable.damping=1e5"], "cable.damping = 100000 N s/m: vehicle and load move"),
        (["load.drag.quadratic=1000"], "load.drag.quadratic = 1000 N s²/m²: stops 0.3 kg within"),
        (["airframe.legs=[[1,0,-1],[1,1,-1],[1,-1,-1]]"], "airframe.legs: all on one side"),
        (["airframe.legs=[[99,0,-0.1],[-9,9,-0.1],[-9,-9,-0.1]]"], "the vehicle turns on them at"),
        (["airframe.legs=[[1,0,1],[-1,1,1],[-1,-1,1]]"], "airframe.legs: none is below"),
        ([HOVER, "initial.load_position=[0,0,0.01]"], "initial.load_position.2 = 0.01 m: 0.04 m of it"),
        ([HOVER, "initial.vehicle_position=[1,0,0.06]"], "initial.vehicle_position.2 = 0.06 m"),
        ([HOVER, "initial.vehicle_position=[0,0,30]"], "the cable pulls with 1651 N there"),
        ([HOVER, "initial.vehicle_position=[0,0,30]", "cable.stiffness=0.5"], "cable.rest_length is 1.5 m"),
        (
            [HOVER, "initial.vehicle_position=[1,0,2.8]", "cable.breaking_tension=10"],
            "the cable pulls with 18 N there, and breaks at 10 N",
        ),
        (["rotors.0.torque_coefficient=1"], "rotors.0.torque_coefficient = 1 N m s²/rad²"),
        ([f"rotors.{i}.max_speed=700" for i in range(4)], "hovering takes 17.66 N; expected more thrust"),
    ],
)
def test_what_cannot_be_is_refused_with_what_would_do(overrides: list[str], says: str) -> None:
    (line,) = faults(*overrides)
    assert says in line
    assert "expected" in line


def test_what_would_do_does() -> None:
    (line,) = faults(HOVER, "initial.vehicle_position=[1,0,20]")
    longest = float(re.search(r"expected up to ([0-9.]+) m", line)[1])  # type: ignore[index]
    assert load_vehicle("iris").cable.rest_length < longest < 19.0
    load_vehicle("iris", [HOVER, f"initial.vehicle_position=[1,0,{0.999 * longest}]", "load.radius=0"])
    load_vehicle("iris", ["airframe.inertia=[0.03, 0.03, 0.06]"])
    load_vehicle("iris", ["cable.breaking_tension=2.95"])


@pytest.mark.parametrize("name", vehicle_names())
@pytest.mark.parametrize("length", [0.5, 5.0, 20.0, 50.0])
def test_a_shipped_vehicle_on_another_cable_stays_valid(name: str, length: float) -> None:
    start = "initial.load_position=[0, 0, 10]"
    load_vehicle(name, [f"cable.rest_length={length}", HOVER, start])


def test_faults_of_bounds_and_of_physics_are_said_at_once(tmp_path: Path) -> None:
    """Each with the line of the file that it is in."""
    file = tmp_path / "mine.toml"
    iris = (Path(__file__).parents[2] / "sitl_bridge/vehicles/iris.toml").read_text(encoding="utf-8")
    text = iris.replace("0.055225]", "5.5]").replace("breaking_tension = 150.0", "breaking_tension = 1.0")
    text = text.replace("[battery]\ncells", "[battery]\ncels").replace(
        "[load]\nmass = 0.3", "[load]\nmass = 0.3\ndrag.linear = -1.0"
    )
    text = text.replace("[load.drag]\nquadratic = 0.00226\n", "")
    file.write_text(text)
    number = {line.split(" = ")[0]: n for n, line in enumerate(text.splitlines(), start=1)}
    lines = faults(source=str(file))
    expected = {
        "airframe.inertia.2 = 5.5": number["inertia"],
        "load.drag.linear = -1": number["drag.linear"],
        "battery.cels = 3: no such key; did you mean battery.cells?": number["cels"],
    }
    assert len(lines) == len(expected), lines
    for beginning, where in expected.items():
        (line,) = (line for line in lines if line.startswith(beginning))
        assert line.endswith(f"(line {where})")
    repaired = text.replace("drag.linear = -1.0\n", "").replace("cels", "cells")
    file.write_text(repaired)
    assert {line.split(" = ")[0] for line in faults(source=str(file))} == {
        "airframe.inertia.2",
        "cable.breaking_tension",
    }


@pytest.mark.parametrize(
    ("override", "guess"),
    [
        ("cabel.stiffness=3", "did you mean cable?"),
        ("cable.rest_lenth=3", "did you mean cable.rest_length?"),
        ("airframe.drag.lineer=3", "did you mean airframe.drag.linear?"),
        ("rotors.0.max_sped=3", "did you mean rotors.0.max_speed?"),
        ("stiffness=3", "did you mean cable.stiffness?"),
        ("sensors.gps.rte=3", "did you mean sensors.gps.rate?"),
        ("cable.model=tension_only", "did you mean tension-only?"),
        ("sensors.preset=consumr", "did you mean consumer?"),
    ],
)
def test_a_mistyped_word_is_guessed(override: str, guess: str) -> None:
    (line,) = faults(override)
    assert guess in line


def test_a_mistyped_vehicle_is_guessed() -> None:
    (line,) = faults(source="irsi")
    assert line.endswith("did you mean iris?")


def test_a_mistyped_table_is_not_also_missing(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    iris = (Path(__file__).parents[2] / "sitl_bridge/vehicles/iris.toml").read_text(encoding="utf-8")
    file.write_text(iris.replace("[cable]", "[cabel]"))
    (line,) = faults(source=str(file))
    assert line.startswith("cabel.stiffness = 60.0, cabel.damping = 0.5")
    assert "no such keys; did you mean cable?" in line


def test_a_value_of_the_command_line_is_said_to_be_from_there() -> None:
    lines = faults("airframe.mass=-1", "cable.stiffness=soft")
    assert all(line.endswith("(--set)") for line in lines)


def test_all_overrides_that_are_none_are_said_at_once() -> None:
    with pytest.raises(DescriptionError) as caught:
        load_vehicle("iris", ["cable", "load.mass=0.2", "rotors.9.max_speed=3"])
    assert len(str(caught.value).splitlines()) == 2


def test_a_preset_is_looked_for_beside_the_vehicle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also one that stands on another beside it; on the command line it is relative to where one is."""
    (tmp_path / "sets").mkdir()
    (tmp_path / "sets/mine.toml").write_text('preset = "base.toml"\n[gps]\nrate = 7\n')
    (tmp_path / "sets/base.toml").write_text('preset = "rtk"\n[gps]\nsatellites = 33\n')
    iris = (Path(__file__).parents[2] / "sitl_bridge/vehicles/iris.toml").read_text(encoding="utf-8")
    file = tmp_path / "mine.toml"
    file.write_text(iris.replace('preset = "consumer"', 'preset = "sets/mine.toml"'))
    gps = load_vehicle(str(file)).sensors.gps
    assert (gps.rate, gps.satellites) == (7.0, 33)
    monkeypatch.chdir(tmp_path / "sets")
    assert load_vehicle(str(file), ["sensors.preset=./mine.toml"]).sensors.gps.satellites == 33
