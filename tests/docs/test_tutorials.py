"""Each tutorial does what it says: notebooks run, blocks of Python and commands too.

Commands that need a PX4 or a network are parsed by `test_site`, not run.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
import yaml
from nbclient import NotebookClient

from tests.docs.notebooks import NOTEBOOKS, notebook
from tests.docs.pages import TUTORIALS, blocks, commands
from tests.patience import LONG_PATIENCE


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_the_notebook_is_the_page(name: str) -> None:
    kept = nbformat.read(TUTORIALS / f"{name}.ipynb", as_version=4)
    assert kept.cells == notebook(name).cells, "python -m tests.docs.notebooks"


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_the_notebook_runs(name: str, tmp_path: Path) -> None:
    run = nbformat.read(TUTORIALS / f"{name}.ipynb", as_version=4)
    NotebookClient(run, timeout=LONG_PATIENCE, resources={"metadata": {"path": str(tmp_path)}}).execute()
    assert sum(cell.cell_type == "code" for cell in run.cells) >= 2
    assert list(tmp_path.glob("*.png"))


def test_the_tests_of_the_ci_tutorial_pass(tmp_path: Path) -> None:
    page = TUTORIALS / "ci.md"
    for block in blocks(page, "python"):
        (tmp_path / block.splitlines()[0].removeprefix("# ")).write_text(block, encoding="utf-8")
    assert "pytest test_take_off.py" in commands(page)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", "."]
    plugin = [] if _has_plugin() else ["-p", "sitl.pytest_plugin"]
    done = subprocess.run([*command, *plugin], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "2 passed" in done.stdout, done.stdout + done.stderr


def _has_plugin() -> bool:
    from importlib.metadata import entry_points

    return "sitl.pytest_plugin" in entry_points(group="pytest11").names


def test_the_workflow_is_one() -> None:
    [text] = blocks(TUTORIALS / "ci.md", "yaml")
    workflow = yaml.safe_load(text)
    steps = workflow["jobs"]["test"]["steps"]
    assert all(("uses" in step) != ("run" in step) for step in steps)
    run = [step["run"] for step in steps if "run" in step]
    assert run.index("sitl warmup") < run.index("pytest")
    [python] = [step for step in steps if step.get("uses", "").startswith("actions/setup-python@")]
    assert "cache" not in python["with"]  # which fails in a repository without requirements.txt
    assert all(re.fullmatch(r"[\w-]+/[\w-]+@v\d+", step["uses"]) for step in steps if "uses" in step)


def test_the_study_flies_and_is_drawn(tmp_path: Path) -> None:
    page = TUTORIALS / "thousand-flights.md"
    [study] = blocks(page, "toml")
    (tmp_path / "mass.toml").write_text(study, encoding="utf-8")
    [sweep] = [command for command in commands(page) if command.startswith("sitl ")]
    environment = {**os.environ, "MPLBACKEND": "Agg"}
    words = [sys.executable, "-m", *shlex.split(sweep)]
    subprocess.run(words, cwd=tmp_path, check=True, capture_output=True, env=environment)
    assert (tmp_path / "runs/mass/study.html").exists()
    [code] = blocks(page, "python")
    drawn = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
        env=environment,
    )
    assert drawn.stdout.startswith("16 flights")
    assert (tmp_path / "mass.png").exists()
