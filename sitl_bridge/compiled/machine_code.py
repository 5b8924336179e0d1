"""Machine code of a module in this process: found in the cache, or compiled now."""

from __future__ import annotations

import ctypes
import importlib
import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from sitl_bridge.compiled import cache, request
from sitl_bridge.compiled.key import key_of
from sitl_bridge.compiled.marks import declarations, declaring_modules


class MachineCode(Protocol):
    """What a module was compiled to."""

    def address(self, symbol: str) -> int:
        """Where a C function is; 0 if there is none of this name."""


class SharedLibrary:
    """Machine code that a linker made a shared library of; the system loads it."""

    def __init__(self, file: Path) -> None:
        with suppress(OSError):  # its functions are looked up in the libraries that everybody sees
            ctypes.CDLL("libm.so.6", ctypes.RTLD_GLOBAL)
        try:
            self._library = ctypes.CDLL(str(file))
        except OSError:  # a file system from which nothing can be executed
            self._library = _from_memory(file)

    def address(self, symbol: str) -> int:
        try:
            return ctypes.cast(self._library[symbol], ctypes.c_void_p).value or 0
        except AttributeError:
            return 0


def _from_memory(file: Path) -> ctypes.CDLL:
    """Load a shared library from a copy in memory."""
    copy = os.memfd_create(file.name)
    try:
        os.write(copy, file.read_bytes())
        return ctypes.CDLL(f"/proc/self/fd/{copy}")
    finally:
        os.close(copy)


class ObjectFile:
    """Machine code of a computer without a linker; LLVM, which compiled it, loads it."""

    def __init__(self, file: Path, symbols: Iterable[str]) -> None:
        import llvmlite.binding as llvm

        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        self._jit = llvm.create_lljit_compiler()
        library = llvm.JITLibraryBuilder().add_object_img(cache.code_of(file)).add_current_process()
        self._symbols = set(symbols)
        for symbol in self._symbols:
            library.export_symbol(symbol)
        self._code = library.link(self._jit, file.name)

    def address(self, symbol: str) -> int:
        return int(self._code[symbol]) if symbol in self._symbols else 0


_loaded: dict[str, MachineCode] = {}


def load(module: str) -> None:
    """Have the machine code of a module's entry points at hand, compiling it if need be."""
    of_module(module)


def missing(modules: Iterable[str]) -> dict[str, str]:
    """Of these imported modules those that are not in the cache, with their keys."""
    keys = {module: key_of(declarations(module)) for module in modules}
    places = cache.directories()
    return {module: key for module, key in keys.items() if cache.find(module, key, places) is None}


def compile_missing(keys: Mapping[str, str], say: request.Say = request.say) -> None:
    """Compile modules, given with their keys, in this order; see `missing`.

    Raises RuntimeError if one cannot be compiled, after the others.
    """
    if keys:
        for outcome in request.compile_modules(keys, say).values():
            _file(outcome)


def of_module(module: str) -> MachineCode:
    """The loaded machine code of a module's entry points.

    What is not in the cache is compiled, and with it what else this process has imported: it will be needed
    next, and together they are compiled in less time.
    """
    if module not in _loaded:
        _loaded[module] = _load(module)
    return _loaded[module]


def _load(module: str) -> MachineCode:
    importlib.import_module(module)
    entries = declarations(module)
    key = key_of(entries)
    file = cache.find(module, key, cache.directories())
    if file is None:
        others = [name for name in declaring_modules() if name != module and name not in _loaded]
        outcomes = request.compile_modules({module: key, **missing(others)}, request.say)
        file = _file(outcomes[module])
    if file.suffix == cache.SHARED_LIBRARY:
        return SharedLibrary(file)
    return ObjectFile(file, [entry.symbol for entry in entries.values()])


def _file(outcome: request.Outcome) -> Path:
    if outcome.file is None:
        raise RuntimeError(outcome.failure)
    return outcome.file
