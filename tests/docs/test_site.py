"""The site builds without a warning, its reference is current, and what pages name exists."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from sitl.command_line.arguments import build_parser
from sitl.reference_pages.mavlink import PLANT_SENDS, plant_sends
from sitl.reference_pages.pages import PAGES
from tests.docs.pages import DOCS, TOP, commands

MARKDOWN = sorted([*DOCS.rglob("*.md"), TOP / "README.md", TOP / "CONTRIBUTING.md"])


def _name(path: Path) -> str:
    return path.relative_to(TOP).as_posix()


def test_the_site_builds_strictly(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    built = subprocess.run(command, cwd=TOP, env=environment, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    start = (tmp_path / "site/index.html").read_text(encoding="utf-8")
    assert 'data-md-color-scheme="default"' in start
    assert 'data-md-color-scheme="slate"' in start
    assert "fonts.googleapis.com" not in start


@pytest.mark.parametrize("page", MARKDOWN, ids=_name)
def test_every_link_on_the_forge_leads_somewhere(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    links = re.findall(r"\]\((?!https?:|mailto:|#)([^)#\s]+)", text)
    assert [link for link in links if not (page.parent / link).exists()] == []


@pytest.mark.parametrize("name", PAGES)
def test_the_reference_is_current(name: str) -> None:
    assert (DOCS / "reference" / name).read_text(encoding="utf-8") == PAGES[name](), (
        "python -m sitl.reference_pages docs/reference"
    )


def test_the_plants_messages_are_all_described() -> None:
    page = (DOCS / "reference/mavlink.md").read_text(encoding="utf-8")
    section = page[page.index("## From the plant") : page.index("## From the autopilot")]
    shown = {int(number) for number in re.findall(r"^\| \[\w+\]\(\S+\) \| (\d+) \|", section, re.MULTILINE)}
    assert shown == plant_sends()
    assert len(PLANT_SENDS) == len(shown)


def test_the_navigation_has_the_four_kinds_of_pages() -> None:
    text = (TOP / "mkdocs.yml").read_text(encoding="utf-8")
    parts = [next(iter(entry)) for entry in yaml.safe_load(text)["nav"]]
    assert parts[1:] == ["Tutorials", "How-to", "Reference", "Explanation"]


@pytest.mark.parametrize("page", [page for page in MARKDOWN if commands(page)], ids=_name)
def test_every_command_in_the_documentation_is_one(page: Path) -> None:
    parser = build_parser()
    for command in commands(page):
        words = shlex.split(command.split(" > ")[0])
        if words[:1] == ["sitl"] and words[1:2] != ["help"] and "…" not in command:
            parser.parse_args(words[1:])


def test_the_readme_is_one_screen_with_a_moving_picture() -> None:
    text = (TOP / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 40
    assert commands(TOP / "README.md") == ["scripts/fly", "scripts/test"]
    [picture] = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text)
    data = (TOP / picture).read_bytes()
    assert data[:4] == b"RIFF"
    assert b"ANIM" in data[:64]
    assert len(data) < 1_500_000
