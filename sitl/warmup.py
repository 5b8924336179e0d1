"""`sitl warmup`: compile everything that flies, so that no flight has to."""

from __future__ import annotations

import importlib
import pkgutil
import sys
import time
from collections.abc import Iterator
from importlib.abc import InspectLoader
from types import ModuleType

from sitl_bridge.compiled import compile_missing, missing
from sitl_bridge.compiled.marks import declaring_modules

PACKAGES = ("sitl_bridge", "controller")
FIRST = ("sitl_bridge.plant.run", "controller.run")
"""What they import is what a first flight needs."""
_BAR = 20


def warm_up() -> int:
    """Compile what is missing, and tell how far it is on standard error; returns the number of modules.

    Raises RuntimeError if something cannot be compiled, after the rest.
    """
    began = time.monotonic()
    wanted = missing(modules())
    progress = Progress(sys.stderr.isatty())
    compile_missing(wanted, progress.say)
    if wanted:
        progress.end(len(wanted), time.monotonic() - began)
    return len(wanted)


def modules() -> list[str]:
    """Names of the modules with compiled entry points, those first that a first flight needs."""
    for name in FIRST:
        importlib.import_module(name)
    for package in PACKAGES:
        for name in _mentioning(importlib.import_module(package), "entry_point"):
            importlib.import_module(name)
    return [name for name in declaring_modules() if name.partition(".")[0] in PACKAGES]


def _mentioning(package: ModuleType, word: str) -> Iterator[str]:
    """Modules of a package, and of those in it, whose source has a word; the others are not imported."""
    for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        spec = info.module_finder.find_spec(info.name, None)
        loader = spec.loader if spec else None
        source = loader.get_source(info.name) if isinstance(loader, InspectLoader) else None
        if source is None or word in source:
            yield info.name


class Progress:
    """How many modules are compiled: a bar in a terminal, lines elsewhere."""

    def __init__(self, terminal: bool) -> None:
        self._terminal = terminal

    def say(self, number: int, total: int, module: str) -> None:
        """Tell that a module is about to be compiled."""
        text = f"compiling {number} of {total}: {module}"
        if self._terminal:
            done = _BAR * (number - 1) // total
            text = f"\r\x1b[K[{'#' * done}{'.' * (_BAR - done)}] {text}"
        print(text, end="" if self._terminal else "\n", file=sys.stderr, flush=True)

    def end(self, total: int, seconds: float) -> None:
        """Tell that all are compiled."""
        text = f"compiled {total} modules in {seconds:.0f} s"
        print(f"\r\x1b[K{text}" if self._terminal else text, file=sys.stderr, flush=True)
