"""The vehicle description: what the shipped ones hold, and what a person reads who gets one wrong."""

import math
from pathlib import Path

import pytest

from sitl_bridge.vehicle.description import Vehicle, hover_rotor_speed
from sitl_bridge.vehicle.files import DescriptionError, load_vehicle, vehicle_names


def faults(*overrides: str, source: str = "paper") -> list[str]:
    with pytest.raises(DescriptionError) as caught:
        load_vehicle(source, overrides)
    assert str(caught.value).splitlines() == [
        f"{caught.value.source}: {line}" for line in caught.value.faults
    ]
    return caught.value.faults


@pytest.fixture(scope="module")
def paper() -> Vehicle:
    return load_vehicle("paper")


def test_paper_is_table_1(paper: Vehicle) -> None:
    assert paper.airframe.mass == 10
    assert paper.load.mass == 10
    assert paper.gravity == 9.81
    assert paper.airframe.inertia == (0.01, 0.01, 0.01)
    assert (paper.cable.stiffness, paper.cable.damping, paper.cable.rest_length) == (100, 10, 1)
    assert paper.cable.model == "two-way"  # eq. 9
    assert [rotor.thrust_coefficient for rotor in paper.rotors] == [0.1] * 4
    assert [rotor.torque_coefficient for rotor in paper.rotors] == [0.5] * 4
    # d = 1 m; front, left, rear, right; 1 and 3 react about -z.
    assert [rotor.position for rotor in paper.rotors] == [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)]
    assert [rotor.direction for rotor in paper.rotors] == ["ccw", "cw", "ccw", "cw"]
    assert paper.disturbance.force_std == 0
    assert paper.loop.delay_ticks == 0


def test_paper_rotors_are_limited_to_exactly_twice_hover_thrust(paper: Vehicle) -> None:
    for rotor in paper.rotors:
        largest = rotor.thrust_coefficient * rotor.max_speed**2
        assert largest == pytest.approx(2 * paper.hover_thrust / 4, rel=1e-15)
        assert rotor.max_speed == pytest.approx(math.sqrt(2) * hover_rotor_speed(paper), rel=1e-15)


def test_equilibrium_is_the_corrected_one(paper: Vehicle) -> None:
    assert paper.hover_length == pytest.approx(1.981, rel=1e-15)
    assert round(hover_rotor_speed(paper), 3) == 22.147
    assert paper.initial_vehicle_position == (0, 0, paper.hover_length)


def test_hover_length_follows_rest_length() -> None:
    assert load_vehicle("paper", ["cable.rest_length=10"]).hover_length == pytest.approx(10.981, rel=1e-15)


@pytest.mark.parametrize("name", vehicle_names())
def test_every_shipped_vehicle_is_valid_and_carries_its_name(name: str) -> None:
    assert load_vehicle(name).name == name


def test_file_by_path_reads_as_the_shipped_one(tmp_path: Path, paper: Vehicle) -> None:
    import sitl_bridge

    shipped = Path(sitl_bridge.__file__).parent / "vehicles" / "paper.toml"
    copy = tmp_path / "mine.toml"
    copy.write_bytes(shipped.read_bytes())
    assert load_vehicle(str(copy)) == paper


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("airframe.mass=-1", ["airframe.mass = -1 kg", "> 0 and <= 10000"]),
        ("airframe.mass=heavy", ["airframe.mass = 'heavy' kg", "number", "> 0 and <= 10000"]),
        ("airframe.mass=nan", ["airframe.mass = nan kg", "finite"]),
        ("airframe.inertia=[0.01, -1, 0.01]", ["airframe.inertia.1 = -1 kg m²", "> 0 and <= 100000"]),
        ("airframe.inertia=[0.01, 0.01]", ["airframe.inertia.2", "missing", "kg m²", "> 0 and <= 100000"]),
        ("rotors.2.max_speed=0", ["rotors.2.max_speed = 0 rad/s", "> 0 and <= 100000"]),
        ("rotors.0.position=[1, 2]", ["rotors.0.position.2", "missing", "in m"]),
        ("rotors.0.direction=left", ["rotors.0.direction = 'left'", "cw or ccw"]),
        ("rotors=[]", ["rotors = []", "4 to 16 tables"]),
        ("rotors=3", ["rotors = 3", "not a list", "4 to 16 tables"]),
        ("rotors.0=3", ["rotors.0 = 3", "not a table"]),
        ("cable=3", ["cable = 3", "a table"]),
        ("cable.material=nylon", ["cable.material = nylon", "cable.model = 'progressive'", "'two-way'"]),
        (
            "cable.model=rope",
            ["cable.model = 'rope'", "two-way or tension-only or linear or progressive or chain"],
        ),
        ("cable.rest_length=true", ["cable.rest_length = True m", "number", "> 0 and <= 1000"]),
        ('cable.rest_length="10"', ["cable.rest_length = '10' m", "number"]),
        (f"cable.rest_length={'9' * 5000}", ["cable.rest_length = '99", "... m", "<= 1000"]),
        ("cable.length=3", ["cable.length = 3", "no such key"]),
        ("cabel.rest_length=3", ["cabel.rest_length = 3", "no such key"]),
        ("loop.delay_ticks=1.5", ["loop.delay_ticks = 1.5 ticks", "integer", ">= 0 and <= 64"]),
        ("disturbance.force_std=-5", ["disturbance.force_std = -5 N", ">= 0 and <= 10000"]),
        ("home.latitude=90", ["home.latitude = 90 deg", ">= -89 and <= 89"]),
        ("load.mass=60", ["rotors give 392.4 N", "hovering takes 686.7 N"]),
        ("rotors.3.direction=ccw", ["rotors:", "leaves nothing to 0, 2", "expected"]),
        ("initial.vehicle_position=[0, 0, 0]", ["initial.vehicle_position", "no cable direction"]),
        ("airframe.mass=1\nload.mass=2", ["airframe.mass = '1\\nload.mass=2' kg", "number"]),
    ],
)
def test_a_fault_is_one_line_with_key_value_unit_and_range(override: str, words: list[str]) -> None:
    (line,) = faults(override)
    assert "\n" not in line
    for word in words:
        assert word in line
    assert len(line) < 160


def test_rotors_that_give_no_yaw_are_refused() -> None:
    (line,) = faults(*(f"rotors.{i}.{change}" for i in range(4) for change in ("torque_coefficient=0",)))
    assert line.startswith("rotors: they cannot give thrust and all three moments independently; expected")
    assert len(line) < 160


@pytest.mark.parametrize(
    ("overrides", "beginning"),
    [
        (("battery.empty_cell_voltage=5",), "battery: empty_cell_voltage = 5 V is above"),
        (("initial.start=hover", "initial.load_position=[0,0,-0.5]"), "initial: hovering begins 0.5 m below"),
        (("initial.start=hover", "ground.height=9"), "initial: hovering begins"),
    ],
)
def test_values_that_exclude_each_other_get_one_line(overrides: tuple[str, ...], beginning: str) -> None:
    (line,) = faults(*overrides, source="iris")
    assert line.startswith(beginning)
    assert "expected" in line


def test_every_fault_gets_its_line() -> None:
    lines = faults("airframe.mass=0", "cable.stiffness=soft", "rotors.3.max_speed=-1", "load.weight=3")
    keys = ["airframe.mass", "rotors.3.max_speed", "cable.stiffness", "load.weight"]
    assert sorted(line.split(" = ")[0] for line in lines) == sorted(keys)


def test_an_empty_file_says_everything_that_it_lacks(tmp_path: Path) -> None:
    file = tmp_path / "empty.toml"
    file.touch()
    lines = faults(source=str(file))
    assert [line.split(":")[0] for line in lines] == ["name", "airframe", "rotors", "cable", "load"]
    assert all("missing; expected" in line for line in lines)


def test_overrides_reach_into_lists_and_absent_tables_and_the_last_one_wins() -> None:
    vehicle = load_vehicle(
        "paper",
        [
            "rotors.1.position.2=0.25",
            "rotors.3.diameter=2",
            "airframe.inertia=[0.01, 0.02, 0.03]",
            "loop.delay_ticks=1",
            "loop.delay_ticks = 2",
            "name=two words",
            "disturbance.acts_on=load",
            "initial.vehicle_position=[1, 2, 3]",
        ],
    )
    assert vehicle.rotors[1].position == (0, 1, 0.25)
    assert [rotor.diameter for rotor in vehicle.rotors] == [None, None, None, 2]
    assert vehicle.airframe.inertia == (0.01, 0.02, 0.03)
    assert vehicle.loop.delay_ticks == 2
    assert vehicle.name == "two words"
    assert vehicle.disturbance.acts_on == "load"
    assert vehicle.initial_vehicle_position == (1, 2, 3)


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("cable.rest_length", ["'cable.rest_length'", "KEY=VALUE"]),
        ("=3", ["'=3'", "KEY=VALUE"]),
        ("cable..rest_length=3", ["KEY=VALUE"]),
        ("rotors.4.max_speed=3", ["rotors.4.max_speed", "'4' is no index of a list of 4"]),
        ("rotors.-1.max_speed=3", ["'-1' is no index of a list of 4"]),
        ("rotors.²=3", ["'²' is no index"]),
        ("name.x=3", ["name.x", "'x' lies below a value that is not a table"]),
    ],
)
def test_a_faulty_override_is_named(override: str, words: list[str]) -> None:
    with pytest.raises(DescriptionError) as caught:
        load_vehicle("paper", [override])
    assert caught.value.source == "--set"
    (line,) = caught.value.faults
    for word in words:
        assert word in line


@pytest.mark.parametrize("name", ["papre", "", "../vehicles/papre", "/nowhere/mine.toml", "mine.toml"])
def test_an_unknown_vehicle_names_those_that_there_are(name: str) -> None:
    (line,) = faults(source=name)
    assert "no such vehicle" in line
    assert "paper" in line
    assert ".toml" in line


def test_a_file_that_is_not_toml(tmp_path: Path) -> None:
    file = tmp_path / "broken.toml"
    file.write_text('name = "x"\nmass 10\n')
    (line,) = faults(source=str(file))
    assert "not valid TOML" in line
    assert "line 2" in line


@pytest.mark.parametrize("name", ["directory.toml", "null\0.toml"])
def test_a_file_that_cannot_be_read(name: str, tmp_path: Path) -> None:
    (tmp_path / "directory.toml").mkdir()
    (line,) = faults(source=str(tmp_path / name))
    assert "cannot be read" in line


def test_a_preset_of_ones_own_stands_on_another(tmp_path: Path) -> None:
    """What it does not say is that of the preset below; what the vehicle says stands above both."""
    mine = tmp_path / "mine.toml"
    mine.write_text('preset = "rtk"\n[gps]\nrate = 5\nsatellites = 30\n')
    changed = load_vehicle("iris", [f"sensors.preset={mine}", "sensors.gps.satellites=11"]).sensors
    rtk = load_vehicle("iris", ["sensors.preset=rtk"]).sensors
    assert changed.preset == str(mine)
    assert changed.gps == rtk.gps.model_copy(update={"rate": 5.0, "satellites": 11})
    assert changed.accelerometer == rtk.accelerometer


def test_a_complete_vehicle_takes_another_preset() -> None:
    """What it has on top of its own preset stays."""
    own = load_vehicle("iris", ["sensors.gps.satellites=11"])
    changed = load_vehicle(own, ["sensors.preset=urban"]).sensors
    urban = load_vehicle("iris", ["sensors.preset=urban"]).sensors
    assert own.sensors.gps != urban.gps
    assert changed == urban.model_copy(update={"gps": urban.gps.model_copy(update={"satellites": 11})})


def test_a_preset_that_stands_on_itself_is_refused(tmp_path: Path) -> None:
    one, two = tmp_path / "one.toml", tmp_path / "two.toml"
    one.write_text(f'preset = "{two}"\n')
    two.write_text(f'preset = "{one}"\n')
    (line,) = faults(f"sensors.preset={one}")
    assert "is based on itself" in line
    assert str(two) in line
