"""Studies: draws, verdicts, rows that outlive a stop, and the command with real workers."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.flights.scenario import Points, load_scenario
from sitl.studies.random_vehicles import random_vehicle
from sitl.studies.sweep.dataset import read_rows, write_rows
from sitl.studies.sweep.draws import draws
from sitl.studies.sweep.study import RandomVehicles, Study, Vary, Verdict, load_study
from sitl.studies.sweep.verdicts import judge
from sitl.studies.sweep.worker import fly_draw, with_reference
from sitl_bridge.vehicle.files import DescriptionError
from tests.patience import LONG_PATIENCE

STUDIES = Path(__file__).parents[3] / "studies"


def study(**more: object) -> Study:
    return Study.model_validate({"name": "mine", "scenario": "hover", "duration": 2.0, **more})


def test_a_grid_is_every_combination_and_designs_are_paired() -> None:
    found = draws(
        study(
            vary=(
                Vary(key="cable.rest_length", values=(1.0, 2.0)),
                Vary(key="load.mass", low=1.0, high=100.0, steps=3, scale="log"),
            ),
            seeds=2,
            designs=("default", "paper"),
        )
    )
    assert len(found) == 2 * 3 * 2 * 2
    assert {draw.inputs["load.mass"] for draw in found} == {1.0, 10.0, 100.0}
    assert len({draw.identity for draw in found}) == len(found)
    default, paper = (
        [{**draw.inputs, "design": ""} for draw in found if draw.inputs["design"] == name]
        for name in ("default", "paper")
    )
    assert default == paper


@pytest.mark.parametrize("sampling", ["latin-hypercube", "sobol", "random"])
def test_samples_fill_the_space_and_are_the_same_again(sampling: str) -> None:
    mine = study(
        sampling=sampling,
        samples=64,
        vary=(Vary(key="load.mass", low=0.0, high=8.0), Vary(key="cable.damping", mean=2.0, std=0.5)),
    )
    found = draws(mine)
    assert [draw.inputs for draw in found] == [draw.inputs for draw in draws(mine)]
    masses = np.array([draw.inputs["load.mass"] for draw in found])
    assert 0.0 <= masses.min() <= 1.0
    assert 7.0 <= masses.max() <= 8.0
    if sampling == "latin-hypercube":  # one in each of 64 strips
        assert sorted((masses * 8.0).astype(int).tolist()) == list(range(64))
    damping = np.array([draw.inputs["cable.damping"] for draw in found])
    assert damping.mean() == pytest.approx(2.0, abs=0.2)
    assert damping.std() == pytest.approx(0.5, abs=0.15)


def test_a_changed_study_shares_what_did_not_change() -> None:
    def identities(*masses: float, **more: object) -> set[str]:
        return {draw.identity for draw in draws(study(vary=(Vary(key="load.mass", values=masses),), **more))}

    assert len(identities(1.0, 2.0) & identities(2.0, 3.0)) == 1
    assert not identities(1.0, 2.0) & identities(1.0, 2.0, set=("cable.damping=1",))


ROWS: Sequence[dict[str, object]] = [
    {"outcome": "settled", "overshoot_pct": 1.0},
    {"outcome": "settled", "overshoot_pct": 12.0},
    {"outcome": "turned over", "overshoot_pct": None},
]


@pytest.mark.parametrize(
    ("verdict", "holds"),
    [
        (Verdict(outcome=("turned over",), at_most=0), False),
        (Verdict(outcome=("turned over",), at_most=1), True),
        (Verdict(outcome=("settled",), at_least=2), True),
        (Verdict(figure="overshoot_pct", at_most=10.0), False),
        (Verdict(figure="overshoot_pct", at_most=10.0, share=0.5), True),
        (Verdict(figure="overshoot_pct", at_least=0.5, at_most=12.0), True),
        (Verdict(figure="nothing", at_most=1.0), False),
    ],
)
def test_verdicts(verdict: Verdict, holds: bool) -> None:
    assert judge((verdict,), ROWS)[0].holds is holds


def test_rows_outlive_a_file_that_was_cut_off(tmp_path: Path) -> None:
    write_rows(tmp_path, [{"identity": "a", "outcome": "settled", "x": 1.5}])
    write_rows(tmp_path, [{"identity": "b", "outcome": "raised", "x": None, "outcome_cause": "why"}])
    (tmp_path / "flights" / "part-00007.parquet").write_bytes(b"PAR1 half of it")
    rows = {row["identity"]: row for row in read_rows(tmp_path)}
    assert rows["a"]["x"] == 1.5
    assert rows["b"]["outcome_cause"] == "why"
    write_rows(tmp_path, [{"identity": "c", "outcome": "settled"}])
    assert len(read_rows(tmp_path)) == 3


def test_a_flight_that_cannot_be_flown_is_a_row() -> None:
    plain = study().model_dump(mode="json")
    refused = fly_draw(plain, {"seed": 0, "design": "default", "load.mass": -1.0}, None)
    assert refused["outcome"] == "refused"
    assert "load.mass" in refused["outcome_cause"]
    assert fly_draw(plain, {"seed": 0, "design": "nonsense"}, None)["outcome"] == "raised"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('name = "x"\n[[vary]]\nkey = "load.mass"\n', "expected values, or low and high"),
        ('name = "x"\n[[vary]]\nkey = "load.mass"\nlow = 2\nhigh = 1\n', "low below high"),
        ('name = "x"\n[[verdict]]\nfigure = "overshoot_pct"\n', "at_most or at_least"),
        ('name = "x"\nsampels = 3\n', "sampels"),
        ("name = \n", "not valid TOML"),
    ],
)
def test_a_wrong_study_is_one_line_for_each_fault(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(text)
    with pytest.raises(DescriptionError, match=says):
        load_study(file)


def test_paths_in_a_study_are_relative_to_it(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    vary = '[[vary]]\nkey = "vehicle"\nvalues = ["iris", "v.toml"]\n'
    file.write_text('name = "x"\nscenario = "s.toml"\n' + vary)
    study = load_study(file)
    assert study.scenario == str(tmp_path / "s.toml")
    assert study.vary[0].values == ("iris", str(tmp_path / "v.toml"))


@pytest.mark.parametrize("file", sorted(STUDIES.glob("*.toml")), ids=lambda file: file.stem)
def test_shipped_studies_are_valid(file: Path) -> None:
    assert draws(load_study(file))


@given(st.integers(0, 10_000))
def test_random_vehicles_are_valid_and_the_same_again(number: int) -> None:
    vehicle = random_vehicle(np.random.default_rng(number), 50.0)
    assert vehicle == random_vehicle(np.random.default_rng(number), 50.0)
    thrust = sum(rotor.thrust_coefficient * rotor.max_speed**2 for rotor in vehicle.rotors)
    assert 1.4 <= thrust / vehicle.hover_thrust <= 4.0 + 1e-9
    assert 0.5 <= vehicle.cable.rest_length <= 50.0


def test_sixty_random_vehicles_fly_steps_of_every_length() -> None:
    """The beginning of studies/random-vehicles.toml: no fall, no overshoot beyond 10 %."""
    full = load_study(STUDIES / "random-vehicles.toml")
    plain = full.model_dump(mode="json")
    rows = [fly_draw(plain, draw.inputs, None) for draw in draws(full)[:60]]
    assert {row["outcome"] for row in rows} <= {"settled", "did not settle"}, rows
    assert sum(row["outcome"] == "settled" for row in rows) >= 57
    assert max(row["overshoot_pct"] or 0.0 for row in rows) <= 10.0


def test_a_dozen_random_vehicles_fly_from_point_to_point() -> None:
    """The beginning of studies/random-points.toml: no fall, no overshoot beyond 10 % at any point."""
    full = load_study(STUDIES / "random-points.toml")
    plain = full.model_dump(mode="json")
    rows = [fly_draw(plain, draw.inputs, None) for draw in draws(full)[:12]]
    assert {row["outcome"] for row in rows} == {"settled"}, rows
    assert max(row["largest_overshoot_pct"] for row in rows) <= 10.0


def test_a_number_in_a_list_of_a_list_is_found_by_its_indices() -> None:
    changed = with_reference(load_scenario("points"), "positions.1.2", 9.0).reference
    before = load_scenario("points").reference
    assert isinstance(changed, Points)
    assert isinstance(before, Points)
    assert changed.positions[1] == (*before.positions[1][:2], 9.0)
    assert changed.positions[0] == before.positions[0]
    for key in ("positions.9.0", "positions.0.3", "positions.0.0.0", "positions.x.0", "hold.0"):
        with pytest.raises(DescriptionError, match=key):
            with_reference(load_scenario("points"), key, 9.0)


@pytest.mark.parametrize("name", ["random-circles", "random-figure-eights", "random-helices"])
def test_random_vehicles_fly_paths_or_are_refused_with_a_figure(name: str) -> None:
    """The beginning of three studies, shorter flights: no fall, and nothing flown far from its path."""
    full = load_study(STUDIES / f"{name}.toml")
    study = {**full.model_dump(mode="json"), "duration": 25.0}
    rows = [fly_draw(study, draw.inputs, None) for draw in draws(full)[:6]]
    assert {row["outcome"] for row in rows} <= {"settled", "did not settle", "refused"}, rows
    flown = [row for row in rows if row["outcome"] != "refused"]
    assert len(flown) >= 3
    assert max(row["tracking_rms_m"] for row in flown) <= 0.05
    assert all("reference.angular_rate" in row["outcome_cause"] for row in rows if row not in flown)


@pytest.mark.parametrize("number", [10014, 10069, 10032])
def test_long_cables_fly_on_their_sensors(number: int) -> None:
    """On 21 to 48 m the estimate's first errors, metres of the load, asked for more than 90 degrees."""
    full = load_study(STUDIES / "random-vehicles-estimate.toml")
    study = {**full.model_dump(mode="json"), "duration": 4.0}
    inputs = {"random_vehicle": number, "seed": number, "design": "default", "feedback": "estimate"}
    for preset in ("rtk", "consumer"):
        row = fly_draw(study, {**inputs, "sensors.preset": preset, "plant.air.wind": [4.0, 4.0, 0.0]}, None)
        assert row["outcome"] in ("settled", "did not settle"), row
        assert row["largest_tilt_deg"] < 60.0


def test_the_command_flies_judges_and_goes_on_where_it_was(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    text = (
        'name = "Mine"\nscenario = "hover"\nduration = 2.0\nseeds = 2\n'
        '[[vary]]\nkey = "load.mass"\nvalues = [5.0, {more}10.0]\n'
        '[[verdict]]\noutcome = ["settled", "did not settle"]\nat_least = {least}\n'
    )
    file.write_text(text.format(more="", least=4))
    command = [
        sys.executable,
        "-m",
        "sitl",
        "sweep",
        str(file),
        "--out",
        str(tmp_path / "out"),
        "--workers",
        "1",
    ]
    first = subprocess.run(
        [*command, "--json"], capture_output=True, text=True, check=False, timeout=LONG_PATIENCE
    )
    assert first.returncode == 0, first.stderr
    result = json.loads(first.stdout)
    assert result["flights"] == 4
    assert result["verdicts"][0]["holds"]
    file.write_text(text.format(more="7.0, ", least=99))
    second = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONG_PATIENCE)
    assert "6 flights, 4 flown already" in second.stderr
    assert second.returncode == 1
    assert "DOES NOT HOLD" in second.stdout
    page = (tmp_path / "out" / "study.html").read_text(encoding="utf-8")
    assert "Over load.mass" in page
    assert "--only" in page
    only = read_rows(tmp_path / "out")[0]["identity"]
    alone = subprocess.run(
        [*command, "--only", only], capture_output=True, text=True, check=False, timeout=LONG_PATIENCE
    )
    assert json.loads(alone.stdout)["inputs"]["load.mass"] in (5.0, 7.0, 10.0)
    assert (tmp_path / "out" / "logs" / only / "flight.png").exists()


def test_random_vehicles_have_a_limit_of_their_own() -> None:
    found = draws(study(samples=5, random_vehicles=RandomVehicles(longest_cable=3.0)))
    assert len({draw.inputs["random_vehicle"] for draw in found}) == 5
