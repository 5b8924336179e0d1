"""scripts/setup and scripts/fly install what is asked for, once: with a Python that notes its commands."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]
NOTES = f"""#!/bin/sh
case "$1 $2" in
"-c "*) exec "{sys.executable}" "$@" ;;
"-m venv") mkdir -p .venv/bin && cp "$0" .venv/bin/python ;;
esac
echo "$@" >>"$NOTED"
"""


class Checkout:
    """A checkout with the scripts, one source, and a Python that notes what it was asked."""

    def __init__(self, folder: Path) -> None:
        self.top, self.noted = folder / "the check out", folder / "noted"
        shutil.copytree(TOP / "scripts", self.top / "scripts")
        shutil.copy(TOP / "pyproject.toml", self.top)
        for package in ("sitl_bridge", "controller"):
            (self.top / package).mkdir()
        self.python = folder / "python"
        self.python.write_text(NOTES)
        self.python.chmod(0o755)

    def run(self, *command: str) -> list[str]:
        """The requirements that it installed, by name of what is beyond the product itself."""
        self.noted.write_text("")
        subprocess.run(
            [str(self.top / command[0]), *command[1:]],
            env={**os.environ, "PYTHON": str(self.python), "NOTED": str(self.noted)},
            cwd=self.top.parent,
            check=True,
            capture_output=True,
        )
        lines = self.noted.read_text().splitlines()
        return [line.rpartition(" ")[2] for line in lines if line.startswith("-m pip install")]


@pytest.fixture
def checkout(tmp_path: Path) -> Checkout:
    return Checkout(tmp_path)


def test_a_second_flight_installs_nothing(checkout: Checkout) -> None:
    assert checkout.run("scripts/fly") == ["."]
    assert checkout.run("scripts/fly", "circle") == []
    assert "-m sitl fly circle" in checkout.noted.read_text()


def test_a_flight_to_look_at_brings_the_view(checkout: Checkout) -> None:
    assert checkout.run("scripts/fly") == ["."]
    assert checkout.run("scripts/fly", "circle", "--view") == [".[view]"]
    assert "-m sitl fly circle --view" in checkout.noted.read_text()
    assert checkout.run("scripts/fly", "circle", "--view") == []


def test_what_is_installed_with_an_extra_serves_without_it(checkout: Checkout) -> None:
    assert checkout.run("scripts/fly", "--view") == [".[view]"]
    assert checkout.run("scripts/fly") == []


def test_what_the_tests_need_serves_every_flight(checkout: Checkout) -> None:
    assert checkout.run("scripts/setup", "test") == [".[test]"]
    assert checkout.run("scripts/fly") == []
    assert checkout.run("scripts/fly", "--view") == []


def test_a_changed_project_is_installed_again(checkout: Checkout) -> None:
    checkout.run("scripts/fly", "--view")
    with (checkout.top / "pyproject.toml").open("a") as project:
        project.write("\n# changed\n")
    assert checkout.run("scripts/fly", "--view") == [".[view]"]
