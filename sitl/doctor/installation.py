"""Checks of what is installed and where files are kept: Python, packages, extras, cache, output folder."""

from __future__ import annotations

import os
import re
import shutil
import sys
import tomllib
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

from sitl.doctor.finding import Finding

DISTRIBUTION = "sitl-bridge"
OLDEST_PYTHON = (3, 11)
LEAST_FREE_MB = 200.0
"""MB of disk that a first compilation and a few flights take."""
_PROJECT = Path(__file__).parents[2] / "pyproject.toml"


def python() -> Finding:
    """Whether this Python is recent enough."""
    version = ".".join(map(str, sys.version_info[:3]))
    if sys.version_info < OLDEST_PYTHON:
        wanted = ".".join(map(str, OLDEST_PYTHON))
        return Finding("fail", "python", f"{version} ({sys.executable})", f"install Python {wanted} or newer")
    return Finding("ok", "python", f"{version} ({sys.executable})")


def packages() -> Finding:
    """Whether every required package is installed, in a version that is allowed."""
    wanted = requirements().get("", [])
    wrong = unmet(wanted)
    if wrong:
        names = " ".join(f'"{text}"' for text, _ in wrong)
        found = ", ".join(f"{text} ({what})" for text, what in wrong)
        return Finding("fail", "packages", found, f"{sys.executable} -m pip install {names}")
    return Finding("ok", "packages", f"{len(wanted)} required packages are installed")


def extras() -> Finding:
    """Which optional features are installed; none of them is needed to fly."""
    missing = [name for name, wanted in requirements().items() if name and unmet(wanted)]
    present = [name for name in requirements() if name and name not in missing]
    found = f"installed: {', '.join(present) or 'none'}; not installed: {', '.join(missing) or 'none'}"
    advice = f'pip install "{DISTRIBUTION}[{",".join(missing)}]" if you want them' if missing else ""
    return Finding("ok", "extras", found, advice)


def requirements() -> dict[str, list[str]]:
    """Requirements by extra, "" for those that are always needed.

    From the checkout's pyproject.toml, else from the metadata of the installed distribution.
    """
    if _PROJECT.is_file():
        project = tomllib.loads(_PROJECT.read_text(encoding="utf-8"))["project"]
        return {"": project["dependencies"], **project["optional-dependencies"]}
    sorted_by_extra: dict[str, list[str]] = {"": []}
    for text in metadata.requires(DISTRIBUTION) or []:
        requirement, _, marker = text.partition(";")
        extra = re.search(r"extra\s*==\s*[\"']([^\"']+)", marker)
        sorted_by_extra.setdefault(extra[1] if extra else "", []).append(requirement.strip())
    return sorted_by_extra


def unmet(wanted: Iterable[str]) -> list[tuple[str, str]]:
    """Requirements that are not met, each with what there is instead."""
    from packaging.requirements import Requirement

    wrong = []
    for text in wanted:
        requirement = Requirement(text)
        try:
            version = metadata.version(requirement.name)
        except metadata.PackageNotFoundError:
            wrong.append((text, "missing"))
            continue
        if not requirement.specifier.contains(version, prereleases=True):
            wrong.append((text, f"{version} is installed"))
    return wrong


def cache() -> Finding:
    """Where compiled machine code is kept, and whether it is there already."""
    from sitl_bridge.compiled import missing
    from sitl_bridge.compiled.cache import directories, takes_files

    places = directories()
    usable = [place for place in places if takes_files(place)]
    if not usable:
        shown = " and ".join(map(str, places))
        return Finding(
            "fail",
            "cache",
            f"{shown} cannot be written",
            "set XDG_CACHE_HOME to a folder that belongs to you and that nobody else can write",
        )
    place = usable[0]
    free = shutil.disk_usage(place).free / 1e6
    if free < LEAST_FREE_MB:
        return Finding(
            "note",
            "cache",
            f"{place}: {free:.0f} MB free",
            f"free {LEAST_FREE_MB:.0f} MB, or set XDG_CACHE_HOME to another disk",
        )
    try:
        from sitl.warmup import modules

        to_compile = len(missing(modules()))
    except ImportError:
        return Finding("note", "cache", str(place), "install the missing packages first")
    if to_compile:
        return Finding(
            "note",
            "cache",
            f"{place}: {to_compile} modules are not compiled yet",
            "run `sitl warmup`, or wait during the first flight",
        )
    return Finding("ok", "cache", f"{place}: everything is compiled")


def output() -> Finding:
    """Whether a flight can leave its logs in the current folder."""
    here = Path.cwd()
    if not os.access(here, os.W_OK | os.X_OK):
        return Finding(
            "fail", "output", f"{here} cannot be written", "change to another folder, or give `--out DIR`"
        )
    free = shutil.disk_usage(here).free / 1e6
    if free < LEAST_FREE_MB:
        return Finding("note", "output", f"{here}: {free:.0f} MB free", "give `--out DIR` on another disk")
    return Finding("ok", "output", f"{here / 'runs'}: flights leave their logs here, unless --out is given")
