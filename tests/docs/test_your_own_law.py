"""The page on laws of one's own: its law flies by its command, and its tables are the code's."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from controller.own_law.interface import Estimate, Reference
from tests.docs.pages import DOCS, blocks, commands
from tests.patience import LONG_PATIENCE

PAGE = DOCS / "your-own-law.md"


def test_the_law_of_the_page_settles_and_leaves_its_picture(tmp_path: Path) -> None:
    _, law = blocks(PAGE, "python")
    (tmp_path / "my_law.py").write_text(law, encoding="utf-8")
    flight = shlex.split(commands(PAGE)[0])
    assert flight[:2] == ["sitl", "fly"]
    command = [sys.executable, "-m", "sitl", *flight[1:]]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=LONG_PATIENCE
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "own law, a tick" in done.stdout
    assert (tmp_path / "my-flight/flight.png").exists()
    summary = json.loads((tmp_path / "my-flight/summary.json").read_text())
    assert summary["settled"]
    assert summary["law"]["name"] == "my_law.py:MyLaw"


@pytest.mark.parametrize(
    ("title", "fields"), [("estimate", Estimate._fields), ("reference", Reference._fields)]
)
def test_the_tables_have_every_field(title: str, fields: tuple[str, ...]) -> None:
    table = PAGE.read_text(encoding="utf-8").split(f"| `{title}.` |")[1].split("\n\n")[0]
    rows = [line.split("|")[1] for line in table.splitlines()[2:]]
    assert re.findall(r"`(\w+)`", " ".join(rows)) == list(fields)
