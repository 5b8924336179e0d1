"""Compile everything that flies, so that no flight has to: `python -m sitl.warmup`, part of the set-up."""

from __future__ import annotations

import importlib
import os
import pkgutil
from concurrent.futures import ThreadPoolExecutor

import controller
import sitl_bridge
from sitl_bridge.compiled import EntryPoint, load


def modules() -> list[str]:
    """Names of the modules that have compiled entry points."""
    found = []
    for package in (sitl_bridge, controller):
        for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            module = importlib.import_module(info.name)
            own = [value for value in vars(module).values() if isinstance(value, EntryPoint)]
            if any(entry.python.__module__ == info.name for entry in own):
                found.append(info.name)
    return found


if __name__ == "__main__":
    with ThreadPoolExecutor(os.cpu_count()) as pool:  # each compiles in a process of its own
        for result in [pool.submit(load, name) for name in modules()]:
            result.result()
