"""The tutorial's commands do what the page shows."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

from tests.patience import PATIENCE

TOP = Path(__file__).parents[3]
PAGE = (TOP / "docs/your-own-vehicle.md").read_text(encoding="utf-8")
COMMANDS = [line for block in re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL) for line in block.splitlines()]
SHOWN, FAULTS = (block.splitlines() for block in re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL))
BY_PHYSICS = 8
"""Lines of what `check` shows that follow from the file alone; the others also from the law's design."""


def test_the_commands_lead_to_a_flight_and_its_picture(tmp_path: Path) -> None:
    new, check, fly = (_run(command, tmp_path) for command in COMMANDS)
    assert [done.returncode for done in (new, check, fly)] == [0, 0, 0], fly.stderr
    found = check.stdout.splitlines()
    assert found[:BY_PHYSICS] == SHOWN[:BY_PHYSICS]
    labels = [line[:18] for line in SHOWN[BY_PHYSICS:]]
    assert [line[:18] for line in found[BY_PHYSICS:]] == labels
    assert "settled" in fly.stdout
    assert (tmp_path / "first-flight/flight.png").stat().st_size > 10_000
    file = tmp_path / "courier.toml"
    text = re.sub("(?m)^inertia = .*", "inertia = [0.02, 0.02, 0.5]", file.read_text(encoding="utf-8"))
    file.write_text(text.replace("\nstiffness", "\nstifness"))
    wrong = _run("sitl vehicle check courier.toml", tmp_path)
    assert wrong.returncode == 2
    assert wrong.stderr.splitlines() == FAULTS


def test_every_flag_of_the_page_is_there() -> None:
    flags = set(re.findall(r"`(--[a-z-]+)", PAGE))
    assert len(flags) > 8
    shown = "".join(_help(part) for part in ("new", "check"))
    assert {flag for flag in flags if flag not in shown} == set()


def _run(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    words = shlex.split(command)
    assert words[0] == "sitl"
    return subprocess.run(
        [sys.executable, "-m", "sitl", *words[1:]],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
        env={**os.environ, "PYTHONPATH": str(TOP)},
    )


def _help(part: str) -> str:
    return _run(f"sitl vehicle {part} --help", TOP).stdout
