"""`sitl warmup`: what it finds, and how it tells."""

import subprocess
import sys

import pytest

from sitl.warmup import Progress, modules, warm_up
from sitl_bridge.compiled import missing


def test_it_finds_what_each_process_needs_the_first_flight_first() -> None:
    # In a process of its own: the order is that of the imports.
    code = "from sitl.warmup import modules; print(*modules())"
    found = subprocess.run(
        [sys.executable, "-c", code], text=True, capture_output=True, check=True
    ).stdout.split()
    for name in ("sitl_bridge.plant.tick", "controller.hil.truth_tick"):
        assert found.index(name) < found.index("controller.hil.estimate_tick")
    assert len(found) == len(set(found))


def test_afterwards_nothing_is_missing_and_again_nothing_is_compiled() -> None:
    warm_up()
    assert missing(modules()) == {}
    again = subprocess.run(
        [sys.executable, "-m", "sitl", "warmup"], text=True, capture_output=True, check=True
    )
    assert (again.stdout, again.stderr) == ("", "nothing to compile\n")


def test_progress_is_a_line_for_each_module(capsys: pytest.CaptureFixture[str]) -> None:
    progress = Progress(terminal=False)
    progress.say(1, 2, "plant")
    progress.say(2, 2, "controller")
    progress.end(2, 4.2)
    assert capsys.readouterr().err.splitlines() == [
        "compiling 1 of 2: plant",
        "compiling 2 of 2: controller",
        "compiled 2 modules in 4 s",
    ]


def test_a_terminal_gets_one_line_with_a_bar(capsys: pytest.CaptureFixture[str]) -> None:
    progress = Progress(terminal=True)
    progress.say(1, 2, "plant")
    progress.say(2, 2, "controller")
    progress.end(2, 4.2)
    first, second, last = capsys.readouterr().err.split("\r\x1b[K")[1:]
    assert first == f"[{'.' * 20}] compiling 1 of 2: plant"
    assert second == f"[{'#' * 10}{'.' * 10}] compiling 2 of 2: controller"
    assert last == "compiled 2 modules in 4 s\n"
