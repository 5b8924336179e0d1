"""Machine code for the few functions that run at every tick, without a compiler's start-up in every flight.

Numba compiles, but importing and initialising it takes over a second, more than a whole flight needs to
start. So it works once, in a process of its own, and its machine code goes into a cache; a flight only loads
that file (milliseconds) through llvmlite, and calls it through ctypes (less than a microsecond).

The cache belongs to the user; all checkouts and environments share it. The name of an entry is a digest of
what is compiled (bytecode and constants, see `_key`), of the versions and of the CPU. Comments, docstrings
and formatting do not change it, nor does the folder of the sources. An entry appears whole or not at all.
Code is loaded only from directories that belong to the user and that nobody else can write.

Three decorators mark what is compiled:

- `@kernel`: a function that other compiled functions call. In a flight it stays plain Python, so tests can
  differentiate it with complex numbers, and a debugger can step through it.
- `@vector_kernel`: one whose loops the compiler may take several elements at a time.
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
import signal
import stat
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from importlib import metadata
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple, TypeVar

import llvmlite.binding as llvm
import numpy as np
from numpy.typing import NDArray

_COMPILING = "SITL_BRIDGE_COMPILING"  # set in the environment of the process that compiles
_MARK = "__compiled_as__"  # attribute of a function that is compiled
_LIBM = {
    name + suffix
    for name in (
        *("sqrt", "cbrt", "hypot", "pow", "exp", "exp2", "expm1", "log", "log2", "log10", "log1p"),
        *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "sincos"),
        *("fmod", "floor", "ceil", "trunc", "rint", "nearbyint", "round"),
    )
    for suffix in ("", "f")
}
_MEMORY = {"memcpy", "memset", "memmove"}
INTERRUPTED = {-signal.SIGINT, -signal.SIGTERM, -signal.SIGHUP}


class Buffer(NamedTuple):
    """An array argument: C-contiguous, of this type and shape."""

    dtype: Any
    shape: tuple[int, ...]


Scalar = type[int] | type[float]


Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Mark a function that compiled code calls; plain Python except while compiling."""
    function.__dict__[_MARK] = "kernel"
    if os.environ.get(_COMPILING):
        from numba import njit

        compiled: Function = njit(error_model="numpy")(function)
        return compiled
    return function


def vector_kernel(function: Function) -> Function:
    """Mark a kernel whose sums may be taken in any order, so that one instruction works on several terms."""
    function.__dict__[_MARK] = "vector kernel"
    if os.environ.get(_COMPILING):
        from numba import njit

        compiled: Function = njit(error_model="numpy", fastmath={"reassoc"})(function)
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
        self.python = kernel(function)
        """The same function, uncompiled; for other compiled functions to call, as a kernel."""
        self.__doc__ = function.__doc__
        self.name = function.__name__
        self.arguments = arguments
        self.returns = returns
        self._function: Any = None

    def bind(self, *arrays: NDArray[Any]) -> Callable[..., Any]:
        """Fix the array arguments; the result takes the scalars and costs little to call.

        Raises TypeError for an array of another type, shape or layout than declared, or that is read-only.
        """
        buffers = sum(isinstance(argument, Buffer) for argument in self.arguments)
        if len(arrays) != buffers:
            raise TypeError(f"{self.name}: {len(arrays)} arrays, expected {buffers}")
        addresses = [self._address(index, array) for index, array in enumerate(arrays)]
        return _bound(self._load(), addresses, arrays, self._scalars())

    def __call__(self, *arguments: Any) -> Any:
        """Call with arrays and scalars; convenient, not fast."""
        count = sum(isinstance(argument, Buffer) for argument in self.arguments)
        return self.bind(*arguments[:count])(*arguments[count:])

    def _scalars(self) -> str:
        """Format of the scalar arguments, for `struct`."""
        return "".join("q" if a is int else "d" for a in self.arguments if not isinstance(a, Buffer))

    def _address(self, index: int, array: NDArray[Any]) -> int:
        declared = self.arguments[index]
        if not isinstance(array, np.ndarray):
            raise TypeError(f"{self.name}: argument {index} is {type(array).__name__}, expected {declared}")
        if array.dtype != np.dtype(declared.dtype) or array.shape != declared.shape:
            raise TypeError(
                f"{self.name}: argument {index} is {array.dtype}{array.shape}, expected {declared}"
            )
        if not array.flags.carray:
            raise TypeError(f"{self.name}: argument {index} is not contiguous, aligned and writeable")
        return int(array.ctypes.data)

    def _load(self) -> Any:
        if self._function is None:
            module = self.python.__module__
            address = _engine(module).get_function_address(_symbol(module, self.name))
            if not address:  # calling it would crash
                raise RuntimeError(f"{module} has no entry point {self.name} at module level")
            self._function = ctypes.CFUNCTYPE(ctypes.c_int64 if self.returns is int else ctypes.c_double)(
                address
            )
        return self._function

    def c_callback(self) -> tuple[str, str]:
        """Compile, in the process that compiles: (LLVM code, name of the C function in it)."""
        import numba

        names = [f"a{index}" for index in range(len(self.arguments))]
        scope: dict[str, Any] = {
            "carray": numba.carray,
            "target": self.python,
        }
        buffers = sum(isinstance(argument, Buffer) for argument in self.arguments)
        values: list[str] = []
        for name, argument in zip(names, self.arguments, strict=True):
            if isinstance(argument, Buffer):
                scope[f"{name}_dtype"] = np.dtype(argument.dtype)
                values.append(f"carray(arrays[{len(values)}], {argument.shape!r}, {name}_dtype)")
            else:
                scope[f"{name}_dtype"] = np.dtype(np.int64 if argument is int else np.float64)
                shape = (len(values) - buffers + 1,)
                values.append(f"carray(arrays[{buffers}], {shape!r}, {name}_dtype)[{len(values) - buffers}]")
        exec(f"def call(arrays):\n    return target({', '.join(values)})", scope)
        result = numba.types.int64 if self.returns is int else numba.types.float64
        arrays = numba.types.CPointer(numba.types.voidptr)
        callback = numba.cfunc(result(arrays))(scope["call"])
        return callback.inspect_llvm(), callback.native_name


def _bound(
    function: Any, addresses: list[int], arrays: tuple[NDArray[Any], ...], scalars: str
) -> Callable[..., Any]:
    """A C function of one pointer, to a table of addresses, as a callable that takes the scalars.

    The scalars go through memory too: for each argument of its own ctypes would take longer than most of
    these functions run.
    """
    values = bytearray(max(1, struct.calcsize(scalars)))
    anchor = (ctypes.c_char * len(values)).from_buffer(values)
    table = np.array([*addresses, ctypes.addressof(anchor)], np.uintp)
    pointer = ctypes.c_void_p(table.ctypes.data)
    call: Callable[..., Any]
    if scalars:
        pack_into = struct.Struct("=" + scalars).pack_into

        def call(*scalars: Any) -> Any:
            pack_into(values, 0, *scalars)
            return function(pointer)

    else:

        def call() -> Any:
            return function(pointer)

    call.keeps = (arrays, table, anchor)  # type: ignore[attr-defined]  # they live as long as it does
    return call


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
    versions = " ".join(f"{name} {metadata.version(name)}" for name in ("numpy", "numba", "llvmlite"))
    target = f"{llvm.get_process_triple()} {llvm.get_host_cpu_name()} {features}"
    return f"{sys.implementation.cache_tag} {versions} {target}"


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _entries(module: str) -> dict[str, EntryPoint]:
    """The entry points that a module defines, by name."""
    values = vars(importlib.import_module(module)).values()
    return {v.name: v for v in values if isinstance(v, EntryPoint) and v.python.__module__ == module}


def _key(module: str) -> str:
    """Digest of all that decides the machine code of a module: functions, constants, versions, CPU."""
    description = _Description()
    description.add(_machine())
    with suppress(LookupError):  # this module itself: how code is made
        description.add(sys.modules[__name__].__spec__.loader.get_code(__name__))  # type: ignore[union-attr]
    for name, entry in sorted(_entries(module).items()):
        description.add((name, entry.python, entry.arguments, entry.returns))
    return description.digest()


class _Description:
    """Digest of Python objects as compiled code depends on them.

    A function counts by its bytecode and by the constants and kernels that it names; not by its comments,
    docstring, line numbers or file.
    """

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        self._seen: dict[int, int] = {}

    def digest(self) -> str:
        return self._hash.hexdigest()

    def add(self, value: Any) -> None:
        value = getattr(value, "py_func", value)  # a kernel in the process that compiles
        if isinstance(value, FunctionType) and _MARK in value.__dict__:
            self._add_kernel(value)
        elif isinstance(value, CodeType):
            self._add_code(value)
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

    def _add_kernel(self, function: FunctionType) -> None:
        if id(function) in self._seen:
            self._text(f"kernel {self._seen[id(function)]}")
            return
        self._seen[id(function)] = len(self._seen)
        self._text(function.__dict__[_MARK])
        self.add(function.__defaults__)
        self._add_code(function.__code__)
        for cell in function.__closure__ or ():
            self.add(cell.cell_contents)
        for name in _names(function.__code__):
            if name in function.__globals__:
                value = function.__globals__[name]
                self.add(value)
                if isinstance(value, ModuleType):
                    self._add_attributes(value, _names(function.__code__))

    def _add_attributes(self, module: ModuleType, names: list[str]) -> None:
        """What code that names a module may take from it; another package's is told by its version."""
        for name in names:
            if name in vars(module):
                self.add(vars(module)[name])

    def _add_code(self, code: CodeType) -> None:
        self._text(
            f"{code.co_argcount} {code.co_flags} {code.co_names} {code.co_varnames} {code.co_freevars}"
        )
        self._hash.update(code.co_code)
        constants = list(code.co_consts)
        if constants and isinstance(constants[0], str):
            constants[0] = None  # the docstring
        self.add(constants)


def _names(code: CodeType) -> list[str]:
    """Names that a function and the functions within it look up: globals and attributes."""
    within = [name for part in code.co_consts if isinstance(part, CodeType) for name in _names(part)]
    return sorted({*code.co_names, *within})


def _file_name(module: str, key: str) -> str:
    return f"{module}.{key[:24]}.native"


def _cache_directories() -> list[Path]:
    """Where cache entries may be, the preferred first; they have to be private."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    of_user = Path(tempfile.gettempdir()) / f"sitl-bridge-{os.getuid()}"
    return [directory for directory in (Path(home) / "sitl-bridge", of_user) if directory.is_absolute()]


def _trusted(directory: Path) -> bool:
    """Whether nobody but this user can have put code there."""
    status = directory.lstat()
    shared = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not shared


def _packed(code: bytes, key: str) -> bytes:
    """A cache entry: one line of JSON, then the object file."""
    return json.dumps({"key": key, "sha256": _digest(code)}).encode() + b"\n" + code


def _valid_code(entry: bytes, key: str) -> bytes | None:
    """The object file of a cache entry, if it is whole and has this key."""
    line, _, code = entry.partition(b"\n")
    try:
        header = json.loads(line)
        fresh = header["key"] == key and header["sha256"] == _digest(code)
    except (ValueError, LookupError, TypeError):
        return None
    return code if fresh else None


def _cached_object(module: str) -> bytes:
    """Machine code of a module's entry points: from the cache, or compiled now."""
    key = _key(module)
    name = _file_name(module, key)
    for directory in _cache_directories():
        try:
            entry = (directory / name).read_bytes() if _trusted(directory) else b""
        except OSError:
            continue
        if code := _valid_code(entry, key):
            return code
    print(f"compiling {module}, once", file=sys.stderr, flush=True)
    entry = _compile(module)
    code = _valid_code(entry, key)
    if code is None:
        raise RuntimeError(f"compiling {module} failed: its sources changed meanwhile")
    if not any(_stored(directory, name, entry) for directory in _cache_directories()):
        print(f"no place to keep the compiled {module}: each start compiles it", file=sys.stderr, flush=True)
    return code


def _stored(directory: Path, name: str, entry: bytes) -> bool:
    """Put a cache entry in place, whole or not at all: two processes may do so at once."""
    temporary = directory / f".{name}.{os.getpid()}"
    try:
        directory.mkdir(mode=0o755, parents=True, exist_ok=True)
        if not _trusted(directory):
            return False
        temporary.touch(mode=0o644)
        temporary.write_bytes(entry)
        temporary.replace(directory / name)
    except OSError:
        with suppress(OSError):
            temporary.unlink()
        return False
    return True


def _compile(module: str) -> bytes:
    """Have a process of its own compile a module; returns the cache entry."""
    if os.environ.get(_COMPILING):
        raise RuntimeError(f"an entry point of {module} is called while a module is imported")
    # The same path as here and, with -P, nothing in front of it; NUMBA_… would change what is compiled.
    command = [sys.executable, "-P", "-c", f"from {__name__} import build; build({module!r})"]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    environment |= {_COMPILING: "1", "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}
    outcome = subprocess.run(
        command, env=environment, stdin=subprocess.DEVNULL, capture_output=True, check=False
    )
    if outcome.returncode in INTERRUPTED:
        raise KeyboardInterrupt  # whoever stopped that meant this process as well
    if outcome.returncode < 0:
        raise RuntimeError(f"compiling {module} was killed by {signal.Signals(-outcome.returncode).name}")
    if outcome.returncode != 0:
        raise RuntimeError(f"compiling {module} failed:\n{outcome.stderr.decode(errors='replace')}")
    return outcome.stdout


def build(module: str) -> None:
    """Compile every entry point of a module, write the cache entry to standard output.

    Runs in the process that compiles.
    """
    output = os.dup(1)
    os.dup2(2, 1)  # whatever else is printed is none of the entry
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=3,
        jit=True,
        codemodel="jitdefault",
    )
    whole = llvm.parse_assembly("")
    for entry in _entries(module).values():
        whole.link_in(_self_contained(entry, machine))
    with open(output, "wb") as standard_output:
        standard_output.write(_packed(bytes(machine.emit_object(whole)), _key(module)))


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
