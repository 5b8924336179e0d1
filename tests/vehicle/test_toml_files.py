"""Files that people write, on any system and with any editor: read, or refused in one line."""

from __future__ import annotations

from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

from controller.over.stack import Stack, read_stack, stack_text
from sitl.flights.scenario import load_scenario
from sitl.studies.sweep.study import load_study
from sitl_bridge.vehicle.errors import DescriptionError
from sitl_bridge.vehicle.files import load_vehicle

GOOD: dict[str, tuple[Callable[[Path], Any], str]] = {
    "vehicle": (
        lambda file: load_vehicle(str(file)),
        (resources.files("sitl_bridge") / "vehicles/iris.toml").read_text(encoding="utf-8"),
    ),
    "scenario": (
        lambda file: load_scenario(str(file)),
        (resources.files("sitl") / "flights/scenarios/setpoint.toml").read_text(encoding="utf-8"),
    ),
    "study": (load_study, 'name = "größer"\nscenario = "setpoint"\n[[vary]]\nkey = "seed"\nvalues = [1]\n'),
    "stack": (read_stack, stack_text(Stack(), ["für PX4"])),
}
every_reader = pytest.mark.parametrize("kind", GOOD)


def written(kind: str, data: bytes, folder: Path) -> Any:
    file = folder / "größe 1.toml"
    file.write_bytes(data)
    return GOOD[kind][0](file)


@every_reader
@pytest.mark.parametrize(
    "change",
    [
        lambda text: "\ufeff" + text,
        lambda text: text.replace("\n", "\r\n"),
        lambda text: "\ufeff" + text.replace("\n", "\r\n"),
    ],
    ids=["byte order mark", "CRLF", "both"],
)
def test_what_editors_do_to_a_file_does_no_harm(
    kind: str, change: Callable[[str], str], tmp_path: Path
) -> None:
    text = GOOD[kind][1]
    as_it_is = written(kind, text.encode(), tmp_path)
    assert written(kind, change(text).encode(), tmp_path) == as_it_is


@every_reader
@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"# gr\xfcn\n", "not UTF-8 text (byte 5)"),
        ("a = 1\n".encode("utf-16"), "not UTF-8 text (byte 1)"),
        (bytes(100), "not valid TOML"),
        (b"# " + b"x" * 1_000_000, "larger than 1 MB"),
        (b"a = " + b"[" * 100_000, "nested too deeply"),
    ],
    ids=["latin-1", "utf-16", "zeros", "large", "deep"],
)
def test_what_is_no_toml_is_refused_in_one_line(kind: str, data: bytes, said: str, tmp_path: Path) -> None:
    with pytest.raises(DescriptionError) as refused:
        written(kind, data, tmp_path)
    [line] = str(refused.value).splitlines()
    assert said in line
    assert line.count("größe 1.toml") == 1


@every_reader
def test_a_folder_is_refused_in_one_line(kind: str, tmp_path: Path) -> None:
    folder = tmp_path / "mine.toml"
    folder.mkdir()
    with pytest.raises(DescriptionError, match="Is a directory") as refused:
        GOOD[kind][0](folder)
    assert str(refused.value).count("mine.toml") == 1


@every_reader
def test_a_file_without_an_end_is_refused(kind: str) -> None:
    with pytest.raises(DescriptionError, match="larger than"):
        GOOD[kind][0](Path("/dev/zero"))


def test_the_line_of_a_fault_is_told_below_a_byte_order_mark(tmp_path: Path) -> None:
    text = "\ufeff" + GOOD["vehicle"][1].replace("\n", "\r\n") + "\r\nwings = 2\r\n"
    with pytest.raises(DescriptionError, match="wings"):
        written("vehicle", text.encode(), tmp_path)
