"""Scripts that fly or draw for the documentation: asked for help, they tell and do nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]
NOT_COMMANDS = {"mkdocs_links.py"}
NEEDS = {"mutate.py": "cosmic_ray"}
"""What no extra brings"""
SCRIPTS = sorted(file.name for file in (TOP / "scripts").glob("*.py") if file.name not in NOT_COMMANDS)


@pytest.mark.parametrize("name", SCRIPTS)
def test_help_is_told_and_nothing_done(name: str, tmp_path: Path) -> None:
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    # Whatever a script writes into the documentation is newer than this file.
    mark = tmp_path / "mark"
    mark.touch()
    command = [sys.executable, str(TOP / "scripts" / name), "--help"]
    done = subprocess.run(command, cwd=TOP, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"usage: {name}")
    written = [file for file in (TOP / "docs").rglob("*") if file.stat().st_mtime > mark.stat().st_mtime]
    assert written == []
