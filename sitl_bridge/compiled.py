"""Machine code for the few functions that run at every tick, without a compiler's start-up in every flight.

Numba compiles, but importing and initialising it takes over a second, more than a whole flight needs to
start. So it works once, in a process of its own, and leaves an object file in a cache; a flight only loads
that file (milliseconds) through llvmlite, and calls it through ctypes (less than a microsecond).

Two decorators mark what is compiled:

- `@kernel`: a function that other compiled functions call. In a flight it stays plain Python, so tests can
  differentiate it with complex numbers, and a debugger can step through it.
- `@entry_point(...)`: a function that Python calls at every tick. Its arguments are arrays of fixed type and
  shape, then scalars. `entry.bind(arrays…)` gives a callable that takes the scalars.

Compiled code neither allocates nor raises; the build refuses a function that would.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import llvmlite
import llvmlite.binding as llvm
import numpy as np
from numpy.typing import NDArray

_COMPILING = "SITL_BRIDGE_COMPILING"  # set in the environment of the process that compiles
_ROOT = Path(__file__).resolve().parent.parent
_LIBM = {"pow", "sin", "cos", "tan", "sqrt", "exp", "log", "atan2", "asin", "acos", "atan", "fmod", "sincos"}
_MEMORY = {"memcpy", "memset", "memmove"}


class Buffer(NamedTuple):
    """An array argument: C-contiguous, of this type and shape."""

    dtype: Any
    shape: tuple[int, ...]


Scalar = type[int] | type[float]


Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Mark a function that compiled code calls; plain Python except while compiling."""
    if os.environ.get(_COMPILING):
        from numba import njit

        compiled: Function = njit(error_model="numpy")(function)
        return compiled
    return function


def entry_point(
    *arguments: Buffer | Scalar, returns: Scalar = int
) -> Callable[[Callable[..., Any]], EntryPoint]:
    """Mark a function that Python calls: a `Buffer` for each array first, then `int` or `float` a scalar."""
    return lambda function: EntryPoint(function, arguments, returns)


class EntryPoint:
    """A compiled function; loaded, and compiled if need be, when it is first bound or called."""

    def __init__(self, function: Callable[..., Any], arguments: tuple[Any, ...], returns: Scalar) -> None:
        self.python = function
        """The same function, uncompiled."""
        self.__doc__ = function.__doc__
        self.name = function.__name__
        self.arguments = arguments
        self.returns = returns
        self._function: Any = None

    def bind(self, *arrays: NDArray[Any]) -> Callable[..., Any]:
        """Fix the array arguments; the result takes the scalars and costs little to call.

        Raises TypeError for an array of another type, shape or layout than declared.
        """
        addresses = [self._address(index, array) for index, array in enumerate(arrays)]
        bound = _Bound(self._load(), *addresses)
        bound.arrays = arrays  # keep alive what the addresses point to
        return bound

    def __call__(self, *arguments: Any) -> Any:
        """Call with arrays and scalars; convenient, not fast."""
        count = sum(isinstance(argument, Buffer) for argument in self.arguments)
        return self.bind(*arguments[:count])(*arguments[count:])

    def _address(self, index: int, array: NDArray[Any]) -> int:
        declared = self.arguments[index]
        if (
            not isinstance(declared, Buffer)
            or array.dtype != np.dtype(declared.dtype)
            or array.shape != declared.shape
            or not array.flags.c_contiguous
        ):
            raise TypeError(
                f"{self.name}: argument {index} is {array.dtype}{array.shape}, expected contiguous {declared}"
            )
        return int(array.ctypes.data)

    def _load(self) -> Any:
        if self._function is None:
            module = self.python.__module__
            kinds: dict[Any, Any] = {int: ctypes.c_int64, float: ctypes.c_double}
            types = [ctypes.c_void_p if isinstance(a, Buffer) else kinds[a] for a in self.arguments]
            address = _engine(module).get_function_address(_symbol(module, self.name))
            self._function = ctypes.CFUNCTYPE(kinds[self.returns], *types)(address)
        return self._function

    def c_callback(self) -> tuple[str, str]:
        """Compile, in the process that compiles: (LLVM code, name of the C function in it)."""
        import numba

        names = [f"a{index}" for index in range(len(self.arguments))]
        scope: dict[str, Any] = {
            "carray": numba.carray,
            "target": numba.njit(error_model="numpy")(self.python),
        }
        types, values = [], []
        for name, argument in zip(names, self.arguments, strict=True):
            if isinstance(argument, Buffer):
                dtype = np.dtype(argument.dtype)
                scope[f"{name}_dtype"] = dtype
                types.append(numba.types.CPointer(numba.from_dtype(dtype)))
                values.append(f"carray({name}, {argument.shape!r}, {name}_dtype)")
            else:
                types.append(numba.types.int64 if argument is int else numba.types.float64)
                values.append(name)
        exec(f"def call({', '.join(names)}):\n    return target({', '.join(values)})", scope)
        result = numba.types.int64 if self.returns is int else numba.types.float64
        callback = numba.cfunc(result(*types))(scope["call"])
        return callback.inspect_llvm(), callback.native_name


class _Bound(partial[Any]):
    """A partial that keeps the arrays alive whose addresses it holds."""

    arrays: tuple[NDArray[Any], ...]


_engines: dict[str, Any] = {}


def load(module: str) -> None:
    """Have the machine code of a module's entry points at hand, compiling it if need be."""
    _engine(module)


def _engine(module: str) -> Any:
    """The loaded machine code of one module's entry points."""
    if module not in _engines:
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        machine = llvm.Target.from_default_triple().create_target_machine(jit=True)
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        engine.add_object_file(llvm.ObjectFileRef.from_data(_cached_object(module)))
        engine.finalize_object()
        _engines[module] = engine
    return _engines[module]


def _symbol(module: str, name: str) -> str:
    return f"{module}.{name}".replace(".", "_")


def _machine() -> str:
    features = llvm.get_host_cpu_features().flatten()
    return f"{llvmlite.__version__} {llvm.get_process_triple()} {llvm.get_host_cpu_name()} {features}"


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _cache_directories() -> list[Path]:
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return [_ROOT / "sitl_bridge" / "__pycache__", Path(home) / "sitl-bridge", Path(tempfile.gettempdir())]


def _valid_object(directory: Path, module: str) -> bytes | None:
    """The cached object file, if it was made on such a machine from these very sources."""
    try:
        manifest = json.loads((directory / f"{module}.native.json").read_text())
        fresh = manifest["machine"] == _machine() and all(
            _digest(_ROOT / name) == digest for name, digest in manifest["sources"].items()
        )
        code = (directory / manifest["object"]).read_bytes() if fresh else b""
        return code if hashlib.sha256(code).hexdigest() == manifest["sha256"] else None
    except (OSError, ValueError, KeyError):
        return None


def _cached_object(module: str) -> bytes:
    """Machine code of a module's entry points: from the cache, or compiled now in a process of its own."""
    directories = _cache_directories()
    for directory in directories:
        if code := _valid_object(directory, module):
            return code
    print(f"compiling {module}, once", file=sys.stderr, flush=True)
    for directory in directories:
        try:
            directory.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(directory, os.W_OK):
            break
    command = [sys.executable, "-c", f"from {__name__} import build; build({module!r}, {str(directory)!r})"]
    environment = {**os.environ, _COMPILING: "1", "PYTHONPATH": os.pathsep.join([str(_ROOT), *sys.path])}
    outcome = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    code = _valid_object(directory, module)
    if outcome.returncode != 0 or code is None:
        raise RuntimeError(f"compiling {module} failed:\n{outcome.stderr}")
    return code


def build(module: str, directory: str) -> None:
    """Compile every entry point of a module into one object file; runs in the process that compiles."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=3,
        jit=True,
        codemodel="jitdefault",
    )
    whole: Any = None
    for value in list(vars(importlib.import_module(module)).values()):
        if isinstance(value, EntryPoint) and value.python.__module__ == module:
            part = _self_contained(value, machine)
            if whole is None:
                whole = part
            else:
                whole.link_in(part)
    code = bytes(machine.emit_object(whole))
    sources = {}
    for loaded in list(sys.modules.values()):
        file = getattr(loaded, "__file__", None)
        if file and Path(file).resolve().is_relative_to(_ROOT) and file.endswith(".py"):
            relative = Path(file).resolve().relative_to(_ROOT)
            if relative.parts[0] in ("sitl_bridge", "controller"):
                sources[str(relative)] = _digest(_ROOT / relative)
    name = f"{module}.native.{hashlib.sha256(code).hexdigest()[:16]}.o"
    manifest = {
        "machine": _machine(),
        "object": name,
        "sha256": hashlib.sha256(code).hexdigest(),
        "sources": sources,
    }
    # Two processes may compile at once: each file appears whole or not at all.
    for file, content in ((name, code), (f"{module}.native.json", json.dumps(manifest).encode())):
        with tempfile.NamedTemporaryFile(dir=directory, delete=False) as temporary:
            temporary.write(content)
        os.replace(temporary.name, Path(directory) / file)


def _self_contained(entry: EntryPoint, machine: Any) -> Any:
    """Optimised LLVM module of one entry point, in which nothing else is visible or left undefined."""
    code, native_name = entry.c_callback()
    symbol = _symbol(entry.python.__module__, entry.name)
    part = llvm.parse_assembly(
        code.replace(f'@"{native_name}"', f"@{symbol}").replace(f"@{native_name}(", f"@{symbol}(")
    )
    for thing in [*part.functions, *part.global_variables]:
        if not thing.is_declaration and thing.name != symbol:
            thing.linkage = "internal"
    passes = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=3))
    passes.getModulePassManager().run(part, passes)
    missing = {f.name for f in part.functions if f.is_declaration and not f.name.startswith("llvm.")}
    if forbidden := missing - _LIBM - _MEMORY:
        raise RuntimeError(f"{entry.name} allocates or raises: it needs {', '.join(sorted(forbidden))}")
    return part
