"""Whatever a person writes into a vehicle's file, it loads or is refused in lines that a person can read."""

from __future__ import annotations

import copy
import datetime
from importlib import resources
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.flights.scenario import Scenario
from sitl_bridge.plant.faults.schedule import Faults
from sitl_bridge.plant.physics.parameters import parameters, step_count
from sitl_bridge.vehicle import files
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.errors import DescriptionError
from sitl_bridge.vehicle.files import load_vehicle, read_toml, validated, vehicle_names

SHIPPED: dict[str, dict[str, Any]] = {
    name: read_toml(name, resources.files("sitl_bridge") / "vehicles", "vehicle")[1]
    for name in vehicle_names()
}

scalars = (
    st.floats()
    | st.integers(-(10**400), 10**400)
    | st.booleans()
    | st.text(max_size=8)
    | st.sampled_from([0.0, -0.0, 1e-320, 1e308, -1e308, 1e5, "iris", "ccw", datetime.date(2026, 1, 1)])
)
values = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=6), inner, max_size=3),
    max_leaves=6,
)


def places(content: Any, above: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The way to every value of nested tables and lists, to these themselves, too."""
    pairs = content.items() if isinstance(content, dict) else enumerate(content)
    found: list[tuple[Any, ...]] = []
    for key, value in pairs:
        found.append((*above, key))
        if isinstance(value, (dict, list)):
            found += places(value, (*above, key))
    return found


@st.composite
def mutated(draw: st.DrawFn) -> dict[str, Any]:
    """A shipped vehicle with up to three values replaced, scaled, removed, renamed or added."""
    content = copy.deepcopy(SHIPPED[draw(st.sampled_from(sorted(SHIPPED)))])
    for _ in range(draw(st.integers(1, 3))):
        way = draw(st.sampled_from(places(content)))
        target: Any = content
        for step in way[:-1]:
            target = target[step]
        kind = draw(st.sampled_from(["replace", "scale", "remove", "rename", "add"]))
        old = target[way[-1]]
        if kind == "replace":
            target[way[-1]] = draw(values)
        elif kind == "scale" and isinstance(old, float):
            target[way[-1]] = old * 10.0 ** draw(st.floats(-300, 300))
        elif kind == "remove":
            del target[way[-1]]
        elif kind == "rename" and isinstance(target, dict):
            target[draw(st.text(max_size=12))] = target.pop(way[-1])
        elif kind == "add" and isinstance(old, dict):
            key = draw(st.sampled_from(sorted(Vehicle.model_fields)) | st.text(max_size=8))
            old[key] = draw(values)
        if not content:
            break
    return content


def refused_in_lines(error: DescriptionError) -> None:
    assert error.faults
    assert len(str(error).splitlines()) == len(error.faults)
    for fault in error.faults:
        assert fault == fault.strip() != ""
        assert len(fault) < 500


@given(mutated())
@settings(max_examples=300, deadline=None)
def test_any_change_of_a_vehicle_loads_or_is_refused_in_lines(content: dict[str, Any]) -> None:
    try:
        vehicle = validated(Vehicle, content, "mine.toml")
    except DescriptionError as error:
        refused_in_lines(error)
        return
    # What is valid can be simulated, in steps that a computer can take.
    parameters(vehicle)
    assert 1 <= step_count(vehicle, 4e-3) < 10_000


@given(st.dictionaries(st.sampled_from([*Scenario.model_fields]) | st.text(max_size=8), values, max_size=5))
@settings(max_examples=100, deadline=None)
def test_any_scenario_is_refused_in_lines(content: dict[str, Any]) -> None:
    try:
        validated(Scenario, content, "mine.toml")
    except DescriptionError as error:
        refused_in_lines(error)


faults_of = st.dictionaries(st.sampled_from(["sensor", "failure", "at", "rotor", "duration"]), values)


@given(st.dictionaries(st.sampled_from([*Faults.model_fields]), st.lists(faults_of, max_size=2) | values))
@settings(max_examples=100, deadline=None)
def test_any_schedule_of_faults_is_refused_in_lines(content: dict[str, Any]) -> None:
    try:
        validated(Faults, content, "faults")
    except DescriptionError as error:
        refused_in_lines(error)


@given(st.text(max_size=30) | st.builds("{}={}".format, st.text(max_size=12), st.text(max_size=12)))
@settings(max_examples=200, deadline=None)
def test_any_override_is_refused_in_lines(text: str) -> None:
    try:
        load_vehicle("iris", [text])
    except DescriptionError as error:
        refused_in_lines(error)


@pytest.mark.parametrize(
    "text",
    [".".join(["a"] * 5000) + "=1", "cable.rest_length=1e999", "rotors.٣.max_speed=3"],
)
def test_an_override_that_is_too_deep_or_too_large_is_refused(text: str) -> None:
    with pytest.raises(DescriptionError) as caught:
        load_vehicle("iris", [text])
    assert len(caught.value.faults) == 1


TEXTS = {
    name: (Path(files.__file__).parents[1] / f"vehicles/{name}.toml").read_text(encoding="utf-8")
    for name in vehicle_names()
}


@given(
    st.sampled_from(sorted(TEXTS)),
    st.lists(
        st.tuples(st.integers(0, 10**6), st.sampled_from(["drop", "double", "insert"]), st.text(max_size=6))
    ),
)
@settings(max_examples=100, deadline=None)
def test_any_edit_of_a_file_loads_or_is_refused_in_lines(
    tmp_path_factory: pytest.TempPathFactory, name: str, edits: list[tuple[int, str, str]]
) -> None:
    """Lines dropped or doubled, characters inserted: also what is no TOML, and lines that are not there."""
    lines = TEXTS[name].split("\n")
    for where, kind, text in edits:
        number = where % len(lines)
        if kind == "insert":
            column = where % (len(lines[number]) + 1)
            lines[number] = lines[number][:column] + text + lines[number][column:]
        else:
            lines[number : number + 1] = [lines[number]] * (2 if kind == "double" else 0) or [""]
    file = tmp_path_factory.mktemp("edited") / "mine.toml"
    file.write_bytes("\n".join(lines).encode("utf-8", "surrogatepass"))
    try:
        load_vehicle(str(file))
    except DescriptionError as error:
        refused_in_lines(error)
