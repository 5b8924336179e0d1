"""The map of the code, and the table of mutation testing, lead to places that exist."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

TOP = Path(__file__).parent.parent
MAP = (TOP / "docs/architecture.md").read_text(encoding="utf-8")
OVERVIEW = (TOP / "docs/explanation.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("text", [MAP, OVERVIEW], ids=["map", "overview"])
def test_every_path_exists(text: str) -> None:
    paths = re.findall(r"`([a-z_]+/[\w/.-]*)`", text)
    assert len(paths) > 10
    missing = [path for path in paths if not (TOP / path).exists()]
    assert missing == []


def test_every_name_is_defined_in_a_file_of_the_map() -> None:
    """`function`, `Class` and `Class.method`, wherever the map names them in code type."""
    files = [TOP / path for path in re.findall(r"`([a-z_]+/[\w/]+\.py)`", MAP)]
    sources = "\n".join(path.read_text(encoding="utf-8") for path in files)
    names = set(re.findall(r"`((?:[A-Z][a-zA-Z]+\.)?[a-zA-Z_]*)`", MAP))
    names -= {"controller", "sitl", "sitl_bridge", "time_usec"}
    assert len(names) > 20
    for name in names:
        for part in name.split("."):
            defined = rf"(def|class) {part}\b|^{part} = |self\.{part} = "
            assert re.search(defined, sources, re.MULTILINE), name


def test_every_file_of_the_mutation_table_exists_and_has_the_line_of_each_known_survivor() -> None:
    table = tomllib.loads((TOP / "tests/mutation.toml").read_text(encoding="utf-8"))["module"]
    for name, module in table.items():
        for path in (*module["files"], *module["tests"]):
            assert (TOP / path).exists(), path
        lines = {line.strip() for path in module["files"] for line in (TOP / path).read_text().splitlines()}
        for survivor in module.get("survivor", ()):
            assert survivor["before"] in lines, (name, survivor["before"])
            assert survivor["reason"], (name, survivor["before"])
