"""What decides the machine code of a module, as a digest: functions, constants, versions, CPU.

A function counts by its bytecode and by the constants and kernels that it names. Comments, docstrings, line
numbers, formatting and the folder of the sources do not count.
"""

from __future__ import annotations

import hashlib
import platform
import sys
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from importlib import metadata
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from sitl_bridge.compiled.marks import Declaration, mark_of

_COMPILER = ("lowering", "kernels", "optimizing", "linking")
_CPU_FIELDS = {
    *("vendor_id", "cpu family", "model", "stepping", "flags"),
    *("CPU implementer", "CPU architecture", "CPU variant", "CPU part", "CPU revision", "Features"),
}


def key_of(entries: Mapping[str, Declaration]) -> str:
    """Digest of all that decides the machine code of these entry points of a module, by name."""
    description = Description()
    description.add(compiler())
    for name, entry in sorted(entries.items()):
        description.add((name, entry.python, entry.arguments, entry.returns))
    return description.digest()


def kernel_key(function: FunctionType, arguments: str) -> str:
    """Digest of all that decides what a kernel is translated to for these types of arguments."""
    description = Description()
    description.add((compiler(), kernel_digest(function), arguments))
    return description.digest()


def kernel_digest(function: FunctionType) -> str:
    """Digest of a kernel and of all that it calls."""
    if function not in _digests:
        _digests[function] = "recursion"
        description = Description()
        description.add_body(function)
        _digests[function] = description.digest()
    return _digests[function]


_digests: WeakKeyDictionary[FunctionType, str] = WeakKeyDictionary()


def compiler() -> str:
    """Digest of the machine, and of the modules that make the code."""
    description = Description()
    description.add((machine(), _sources()))
    return description.digest()


@cache
def machine() -> str:
    """The versions and the CPU that machine code is made by and for."""
    versions = " ".join(f"{name} {_version(name)}" for name in ("numpy", "numba", "llvmlite"))
    system = f"{sys.platform} {platform.machine()} {sys.implementation.cache_tag}"
    return f"{system} {versions} {_cpu()}"


def _version(distribution: str) -> str:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return "none"


def _cpu() -> str:
    """What the first processor can do."""
    with suppress(OSError), Path("/proc/cpuinfo").open() as lines:
        first = [line.partition(":") for line in iter(lines.readline, "\n") if line]
        return " ".join(value.strip() for name, _, value in first if name.strip() in _CPU_FIELDS)
    return platform.processor()


@cache
def _sources() -> str:
    description = Description()
    for name in _COMPILER:
        # Not by the module's own loader: under pytest that is another one.
        loader = SourceFileLoader(f"{__package__}.{name}", str(Path(__file__).with_name(f"{name}.py")))
        description.add(loader.get_code(loader.name))
    return description.digest()


class Description:
    """Digest of Python objects as compiled code depends on them."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def digest(self) -> str:
        """Of all that was added, in order; hexadecimal."""
        return self._hash.hexdigest()

    def add(self, value: Any) -> None:
        """Take in a value that compiled code names, and all that it names in turn."""
        if isinstance(value, FunctionType) and mark_of(value):
            self._text(f"kernel {kernel_digest(value)}")
        elif isinstance(value, CodeType):
            self._add_code(value, next(iter(value.co_consts), None))
        elif isinstance(value, tuple | list):
            self._text(f"{type(value).__qualname__} of {len(value)}")
            for item in value:
                self.add(item)
        elif isinstance(value, np.ndarray | np.generic):
            self._text(f"{value.dtype!r} {value.shape}")
            self._hash.update(value.tobytes())
        elif isinstance(value, frozenset):
            self._text(f"frozenset {sorted(map(repr, value))}")
        elif isinstance(value, bool | int | float | complex | str | bytes | np.dtype | None):
            self._text(f"{type(value).__qualname__} {value!r}")
        elif isinstance(value, type | ModuleType | FunctionType | BuiltinFunctionType):
            self._text(f"{getattr(value, '__module__', '')} {value.__name__}")
        else:
            self._text(type(value).__qualname__)  # nothing that the compiler can take in

    def _text(self, text: str) -> None:
        self._hash.update(text.encode() + b"\0")

    def add_body(self, function: FunctionType) -> None:
        """Take in a kernel itself."""
        self._text(str(mark_of(function)))
        self.add(function.__defaults__)
        self._add_code(function.__code__, function.__doc__)
        for cell in function.__closure__ or ():
            self.add(cell.cell_contents)
        names = _names(function.__code__)
        for name in names:
            if name in function.__globals__:
                value = function.__globals__[name]
                self.add(value)
                if isinstance(value, ModuleType):
                    self._add_attributes(value, names)

    def _add_attributes(self, module: ModuleType, names: list[str]) -> None:
        """What code that names a module may take from it."""
        for name in names:
            if name in vars(module):
                self.add(vars(module)[name])

    def _add_code(self, code: CodeType, docstring: object) -> None:
        self._text(
            f"{code.co_argcount} {code.co_flags} {code.co_names} {code.co_varnames} {code.co_freevars}"
        )
        self._hash.update(code.co_code)
        constants = list(code.co_consts)
        if isinstance(docstring, str) and constants[:1] == [docstring]:
            constants[0] = None
        self.add(constants)


def _names(code: CodeType) -> list[str]:
    """Names that a function and the functions within it look up: globals and attributes."""
    within = [name for part in code.co_consts if isinstance(part, CodeType) for name in _names(part)]
    return sorted({*code.co_names, *within})
