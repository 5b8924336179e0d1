"""A module of entry points, compiled by real processes into a cache of its own."""

import importlib
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from sitl_bridge.compiled import machine_code
from tests.patience import PATIENCE

NAME = "native_sample"
SOURCE = '''
import math

import numpy as np

from sitl_bridge.compiled import Buffer, entry_point, kernel

SCALE = 3.0
RECORD = np.dtype([("gain", "f8"), ("on", "b1"), ("table", "f8", 4)])


@kernel
def wave(x):
    return SCALE * math.sin(x) + math.hypot(x, 1.0)


@entry_point(Buffer(RECORD, (1,)), Buffer(np.float64, (4,)), int, float)
def apply(record, out, rounds, x):
    """Add waves to `out`, return how many."""
    p = record[0]
    for k in range(rounds):
        for i in range(4):
            out[i] += p.gain * p.table[i] * wave(x + k) ** 1.5 if p.on else wave(x * k) - i
    return rounds * 4


@entry_point(float, returns=float)
def alone(x):
    return wave(x) ** 2


@entry_point(float, float, returns=float)
def ratio(a, b):
    return a / b


@entry_point(Buffer(np.float64, (2, 3)), int, int, returns=float)
def element(table, row, column):
    return table[row, column]
'''
FLIGHT = """
import sys
import native_sample
print(native_sample.alone(0.25))
assert "numba" not in sys.modules
assert "llvmlite" not in sys.modules or sys.argv[1:] == ["without linker"]
"""


class Sample:
    """Compiled by two processes at the same time."""

    def __init__(self, folder: Path) -> None:
        self.home = folder / "home"
        self.cache = self.home / "sitl-bridge"
        self.source = folder / f"{NAME}.py"
        self.source.write_text(SOURCE)
        two = [self.start() for _ in range(2)]
        self.outcomes = [(*process.communicate(timeout=PATIENCE), process.returncode) for process in two]

    def start(self, *arguments: str, **variables: str) -> subprocess.Popen[str]:
        """A process that calls what is compiled."""
        path = os.pathsep.join([str(self.source.parent), *sys.path])
        environment = {**os.environ, "PYTHONPATH": path, "XDG_CACHE_HOME": str(self.home), **variables}
        environment["PYTHONDONTWRITEBYTECODE"] = "1"  # the source changes faster than its time stamp tells
        return subprocess.Popen(
            [sys.executable, "-c", FLIGHT, *arguments],
            env=environment,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )

    def file(self) -> Path:
        (file,) = code_files(self.cache)
        return file


def code_files(cache: Path) -> list[Path]:
    """The files of machine code in a cache."""
    return sorted(file for file in cache.iterdir() if file.suffix in (".so", ".o"))


def kernel_files(cache: Path) -> list[Path]:
    """The files of translated kernels in a cache."""
    return sorted(cache.glob("kernel.*.bc"))


def put(file: Path, content: bytes) -> None:
    """Other contents under the name of a file that this process may have loaded."""
    file.unlink()
    file.write_bytes(content)


def fresh(name: str = NAME) -> ModuleType:
    """The sample as a process that has just started imports it."""
    sys.modules.pop(name, None)
    machine_code._loaded.pop(name, None)
    importlib.invalidate_caches()
    return importlib.import_module(name)


def loaded() -> ModuleType:
    """The sample with its machine code, as a process that has just started has it."""
    module = fresh()
    assert module.alone(0.25) == pytest.approx(module.alone.python(0.25), rel=1e-15)
    return module
