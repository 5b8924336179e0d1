"""From point to point: the same flight in one process and in two, a law of one's own, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import sitl
from sitl.command_line import commands as cli
from sitl.flights.refusals import check_feasible
from sitl.flights.scenario import (
    MOST_POINTS,
    Points,
    Scenario,
    load_scenario,
    scenario_vehicle,
    with_agility,
)
from sitl_bridge.event_log import read_events
from sitl_bridge.vehicle.files import DescriptionError, load_vehicle
from tests.sitl.flights.test_own_law import EXAMPLES, ONE_PROCESS, TOP, command, two_processes

SHORT = """vehicle = "{vehicle}"
duration = 14.0
[reference]
kind = "points"
positions = [[0.5, 0.0, 5.0], [0.5, 0.6, 5.0], [0.0, 0.0, 5.5]]
hold = 0.2
"""


@pytest.mark.parametrize(("vehicle", "feedback"), [("paper", "truth"), ("iris", "estimate")])
def test_two_processes_fly_the_same_legs(vehicle: str, feedback: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(SHORT.format(vehicle=vehicle))
    start = "initial.load_position=[0,0,5]"
    summaries = []
    for name, how in (("here", ONE_PROCESS), ("apart", two_processes())):
        found = command(
            *("fly", str(file), "--set", start, "--feedback", feedback, "--seed", "4", "--json"),
            *("--out", str(tmp_path / name), *how),
        )
        summaries.append(json.loads(found.stdout))
    here, apart = summaries
    assert here["completed"]
    assert here["state_log_sha256"] == apart["state_log_sha256"]
    assert here["points"] == apart["points"]
    assert None not in [point["set_at_s"] for point in here["points"]]
    told = [[e.text for e in read_events(tmp_path / name) if e.kind == "mode"] for name in ("here", "apart")]
    assert told[0] == told[1] == ["to point 2 of 3", "to point 3 of 3"]


def test_a_law_of_ones_own_flies_from_point_to_point() -> None:
    flight = sitl.fly("points", law=f"{TOP / 'examples/laws/cascaded_pid.py'}:{EXAMPLES['cascaded_pid.py']}")
    points = flight.summary["points"]
    assert None not in [point["set_at_s"] for point in points]
    assert all(point["largest_error_at_end_m"] < 0.25 * point["step_m"] for point in points)
    assert flight.reference[-1].tolist() == points[-1]["position_m"]


def test_each_leg_is_judged_before_it_is_flown() -> None:
    positions = ((0.0, 0.0, 5.0), (1.0, 0.0, -1.0), (0.0, 0.0, 5.0), (0.0, 1.0, -2.0))
    scenario = Scenario(vehicle="iris", reference=Points(kind="points", positions=positions))
    vehicle = scenario_vehicle(scenario, None, [])
    with pytest.raises(DescriptionError) as caught:
        check_feasible(scenario, vehicle, "default")
    assert [line.split(" ")[0] for line in caught.value.faults] == [
        "reference.positions.1.2",
        "reference.positions.3.2",
    ]


@pytest.mark.parametrize(
    ("positions", "says"),
    [
        ("[]", f"too few; allowed: 1 to {MOST_POINTS} entries"),
        ("[[0, 0]]", "positions.0"),
        ("[[0, 0, true]]", "a finite number"),
        (f"[{'[0, 0, 5],' * (MOST_POINTS + 1)}]", f"too many; allowed: 1 to {MOST_POINTS} entries"),
    ],
)
def test_what_is_no_sequence_is_one_line(positions: str, says: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(f'vehicle = "paper"\n[reference]\nkind = "points"\npositions = {positions}\n')
    with pytest.raises(DescriptionError, match=says):
        load_scenario(str(file))


def test_agility_is_that_of_every_leg() -> None:
    gentle = with_agility(load_scenario("points"), 0.0)
    path = gentle.reference.path((0.0, 0.0, 5.0))  # type: ignore[union-attr]
    assert set(path["agility"].tolist()) == {0.0}


@pytest.mark.parametrize("how", [("fly", "points"), ("controller", "--scenario", "points")])
def test_a_stack_is_not_flown_from_point_to_point(
    how: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([*how, "--over", "udpin:127.0.0.1:14540", "--vehicle", "iris"]) == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith("--over: a sequence of points is not flown")


def test_one_point_is_a_set_point() -> None:
    vehicle = load_vehicle("paper", [])
    flights = [
        sitl.fly(Scenario(vehicle="paper", reference=reference), vehicle=vehicle, duration_s=4.0)
        for reference in (
            Points(kind="points", positions=((1.0, 0.5, 0.2),)),
            load_scenario("setpoint").reference.model_copy(update={"position": (1.0, 0.5, 0.2)}),
        )
    ]
    assert flights[0].states["load_x_m"].tolist() == flights[1].states["load_x_m"].tolist()
