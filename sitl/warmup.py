"""`sitl warmup`: compile everything that flies, so that no flight has to."""

from __future__ import annotations

import importlib
import pkgutil
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib.abc import InspectLoader
from types import ModuleType

from sitl_bridge.compiled import compile_missing, missing, request
from sitl_bridge.compiled.marks import declaring_modules

PACKAGES = ("sitl_bridge", "controller")
FIRST = ("sitl_bridge.plant.run", "controller.run")
"""What they import is what a first flight needs."""
_BAR = 20


def warm_up() -> None:
    """Compile what is missing, the plant's and the autopilot's side by side.

    Tells how far it is on standard error. Raises RuntimeError if something cannot be compiled.
    """
    began = time.monotonic()
    wanted = missing(modules())
    progress = Progress(len(wanted), sys.stderr.isatty())
    lanes: dict[str, dict[str, str]] = {}  # whoever compiles a package compiles its shared kernels once
    for module, key in wanted.items():
        lanes.setdefault(module.partition(".")[0], {})[module] = key
    with ThreadPoolExecutor(len(lanes) or 1) as pool:
        try:
            for lane in [pool.submit(compile_missing, keys, progress.say) for keys in lanes.values()]:
                lane.result()
        except KeyboardInterrupt:
            request.stop()
            raise
    progress.end(time.monotonic() - began)


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

    def __init__(self, total: int, terminal: bool) -> None:
        self._total = total
        self._terminal = terminal
        self._begun = 0
        self._lock = threading.Lock()

    def say(self, number: int, total: int, module: str) -> None:
        """Tell that another module is about to be compiled. It is counted here, over all packages."""
        with self._lock:
            self._begun += 1
            text = f"compiling {self._begun} of {self._total}: {module}"
            if self._terminal:
                done = _BAR * (self._begun - 1) // self._total
                text = f"\r\x1b[K[{'#' * done}{'.' * (_BAR - done)}] {text}"
            print(text, end="" if self._terminal else "\n", file=sys.stderr, flush=True)

    def end(self, seconds: float) -> None:
        """Tell that all are compiled."""
        what = f"compiled {self._total} modules in {seconds:.0f} s" if self._total else "nothing to compile"
        print(f"\r\x1b[K{what}" if self._terminal else what, file=sys.stderr, flush=True)
