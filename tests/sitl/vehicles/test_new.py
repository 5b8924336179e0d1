"""`sitl vehicle new`: whatever figures it takes, the file is valid, and the default law flies it."""

from __future__ import annotations

import io
import itertools
import math
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from controller.design.feasibility import vehicle_faults
from sitl.command_line.commands import main
from sitl.vehicles.check import fly_step
from sitl.vehicles.commented import toml_text
from sitl.vehicles.sketch import Sketch, described, inertia
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import completed, load_vehicle, validated
from sitl_bridge.vehicle.rotors import full_thrust


def logarithmic(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(math.log(low), math.log(high)).map(lambda x: min(high, max(low, math.exp(x))))


@st.composite
def sketches(draw: st.DrawFn) -> dict[str, Any]:
    """Figures from the whole of the documented ranges; arms as multicopters of the mass have them."""
    mass = draw(logarithmic(0.2, 60.0))
    return {
        "mass": mass,
        "arm": min(2.0, max(0.05, 0.22 * math.cbrt(mass) * draw(st.floats(0.6, 1.6)))),
        "rotors": draw(st.sampled_from([4, 6, 8])),
        "thrust_to_weight": draw(st.floats(1.4, 6.0)),
        "load_mass": min(60.0, max(0.01, mass * draw(logarithmic(0.02, 1.5)))),
        "cable_length": draw(logarithmic(0.5, 50.0)),
        "stretch_share": draw(logarithmic(0.001, 0.6)),
        "cable_damping": draw(logarithmic(0.01, 1.0)),
        "rotor_lag": draw(st.floats(0.0, 0.1)),
    }


def read_back(figures: dict[str, Any]) -> Vehicle:
    """The vehicle that the file of these figures describes."""
    text = toml_text(described(validated(Sketch, figures, "new")), "a test")
    return validated(Vehicle, completed(tomllib.loads(text)), "mine.toml")


@given(sketches())
@settings(max_examples=200, deadline=None)
def test_every_file_is_valid_and_says_what_was_asked_for(figures: dict[str, Any]) -> None:
    vehicle = read_back(figures)
    assert vehicle.airframe.mass == figures["mass"]
    assert vehicle.load.mass == figures["load_mass"]
    assert len(vehicle.rotors) == figures["rotors"]
    assert math.hypot(*vehicle.rotors[0].position) == pytest.approx(figures["arm"], rel=1e-4)
    ratio = full_thrust(vehicle.rotors) / vehicle.hover_thrust
    assert ratio == pytest.approx(figures["thrust_to_weight"], rel=1e-4)
    stretch = vehicle.hover_length - vehicle.cable.rest_length
    assert stretch / vehicle.cable.rest_length == pytest.approx(figures["stretch_share"], rel=1e-3)


@given(sketches(), st.sampled_from([1.0, 20.0]))
@example({"mass": 0.2, "rotors": 8, "load_mass": 0.3, "cable_length": 50.0, "stretch_share": 0.6}, 1.0)
@example({"mass": 60.0, "thrust_to_weight": 1.4, "load_mass": 60.0, "cable_length": 0.5}, 20.0)
@settings(max_examples=6, deadline=None, derandomize=True)
def test_the_default_law_flies_it(figures: dict[str, Any], length: float) -> None:
    vehicle = read_back(figures)
    assume(not vehicle_faults(vehicle))
    step = fly_step(vehicle, length)
    assert step.outcome == "settled", step
    assert step.overshoot_pct is not None
    assert step.overshoot_pct < 10.0


def test_moments_of_inertia_are_those_of_points_on_a_ring_about_a_ball() -> None:
    """Summed over points, for any number of rotors."""
    mass, arm = 2.0, 0.3
    for count in (4, 6, 8):
        angles = [2.0 * math.pi * (k + 0.5) / count for k in range(count)]
        ball = 0.4 * 0.6 * mass * (0.3 * arm) ** 2
        about_x = sum(0.4 * mass / count * (arm * math.sin(a)) ** 2 for a in angles) + ball
        about_z = sum(0.4 * mass / count * arm**2 for _ in angles) + ball
        assert inertia(mass, arm) == pytest.approx((about_x, about_x, about_z), rel=1e-12)


def test_throttle_thrust_and_ratio_say_the_same() -> None:
    weight = 2.0 * 9.81
    ways = ({"thrust_to_weight": 2.25}, {"hover_throttle": 1.0 / 1.5}, {"max_thrust": 2.25 * weight})
    thrusts = [full_thrust(read_back({"mass": 1.6, "load_mass": 0.4, **way}).rotors) for way in ways]
    assert thrusts == pytest.approx([2.25 * weight] * 3, rel=1e-4)


def lines_of(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> list[str]:
    """What a command says: its output, or its errors where it fails."""
    assert main(["vehicle", *arguments]) == code
    said = capsys.readouterr()
    return (said.err if code else said.out).splitlines()


def test_a_file_is_not_overwritten_unless_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "mine.toml"
    assert main(["vehicle", "new", str(file), "--mass", "2"]) == 0
    before = file.read_bytes()
    capsys.readouterr()
    (line,) = lines_of(capsys, "new", str(file), "--mass", "3", code=2)
    assert line == f"{file}: exists already; expected another file, or --force"
    assert file.read_bytes() == before
    assert main(["vehicle", "new", "--out", str(file), "--mass", "3", "--force"]) == 0
    assert load_vehicle(str(file)).airframe.mass == 3


def test_every_first_key_has_a_comment(capsys: pytest.CaptureFixture[str]) -> None:
    lines = lines_of(capsys, "new", "--mass", "2", "--stretch", "5%", "--cable-length", "4")
    first_rotor = lines.index("[[rotors]]")
    keys = [
        (before, line)
        for before, line in itertools.pairwise(lines[: first_rotor + 9])
        if " = " in line and not line.startswith("#")
    ]
    assert len(keys) > 15
    assert all("# " in line or before.startswith("# ") for before, line in keys)
    vehicle = validated(Vehicle, completed(tomllib.loads("\n".join(lines))), "output")
    assert vehicle.hover_length == pytest.approx(4.2, rel=1e-4)


@pytest.mark.parametrize(
    ("flags", "says"),
    [
        (["--mass", "-1"], "mass = -1 kg: input should be greater than or equal to 0.2"),
        (["--mass", "nan"], "mass = nan kg"),
        (["--mass", "heavy"], "mass = 'heavy' kg: input should be a valid number"),
        (["--mass", "2", "--rotors", "5"], "rotors = 5: no such value; allowed: 4 or 6 or 8"),
        (["--mass", "2", "--thrust-to-weight", "2", "--hover-throttle", "0.7"], "expected one"),
        (["--mass", "2", "--load-mass", "5"], "expected 0.04 to 3 kg"),
        (["--mass", "2", "--stretch", "3"], "stretch = 3 m: 1.8e+02 % of the cable"),
        (["--mass", "2", "--stretch", "x%"], "stretch_share = 'x%'"),
        (["--mass", "2", "--sensors", "consumr"], "did you mean consumer?"),
        (["--mass", "2", "--name", ""], "name = ''"),
    ],
)
def test_what_cannot_be_is_one_line(flags: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    (line,) = lines_of(capsys, "new", *flags, code=2)
    assert says in line


def test_without_a_mass_it_asks(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A wrong answer is asked for again; an empty one takes the default; what a flag says is not asked."""
    answers = ["asked", "-3", "2.5", "6", "", "2.5", "0.5", "", "4%"]
    monkeypatch.setattr("sys.stdin", io.StringIO("\n".join(answers) + "\n"))
    file = tmp_path / "mine.toml"
    assert main(["vehicle", "new", str(file), "--cable-length", "2"]) == 0
    said = capsys.readouterr().err
    assert "mass = -3 kg" in said
    assert "cable length:" not in said
    vehicle = load_vehicle(str(file))
    assert (vehicle.name, vehicle.airframe.mass, len(vehicle.rotors)) == ("asked", 2.5, 6)
    assert vehicle.load.mass == 0.5


def test_nobody_who_answers(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    line = lines_of(capsys, "new", code=2)[-1]
    assert line.endswith("--mass: missing; expected kg, or answers on standard input")
