"""What kernels are translated to: one LLVM module each, kept in the cache for the next compilation.

An edit translates the kernels that it changes and those that call them; all others are read. Only the kernel
is visible in its module. Its symbol has the key of the kernel and of the types of its arguments; modules call
each other by these symbols.
"""

from __future__ import annotations

import pickle
import re
from contextlib import suppress
from pathlib import Path
from types import FunctionType
from typing import Any

import llvmlite.binding as llvm
from numba.core import codegen, types
from numba.core.caching import _Cache
from numba.core.compiler import compile_result
from numba.core.environment import Environment

from sitl_bridge.compiled import cache, optimizing
from sitl_bridge.compiled.key import kernel_key

_SYMBOL = re.compile(r"_ZN\d+(kernel\..*)\.([0-9a-f]{64})E")
"""Of a kernel: name and key, in the form that Numba's own symbols have."""

places: list[Path] = []
"""Where modules are kept."""

_modules: dict[str, Any] = {}
"""LLVM modules of this process, by symbol."""


class Collected(codegen.JITCodeLibrary):  # type: ignore[misc]  # Numba has no types
    """The LLVM module of one function, and the libraries of those that it calls."""

    symbol = ""
    """Of a kernel; other functions are Numba's own."""

    def _optimize_functions(self, ll_module: Any) -> None:
        pass

    def finalize(self) -> None:
        self._final_module.verify()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        return 0


class KernelCache(_Cache):  # type: ignore[misc]  # Numba has no types
    """Numba asks it for what a kernel is translated to, and gives it what is new."""

    cache_path = None

    def __init__(self, function: FunctionType) -> None:
        self._function = function

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Numba's result for these types of arguments, or None."""
        symbol = self._symbol(sig)
        found = symbol and _load(symbol)
        if not found:
            return None
        signature, description = found
        library = target_context.codegen().create_library(symbol)
        library.symbol = symbol
        library._finalized = True
        environment = Environment.from_fndesc(description)
        return compile_result(
            typing_context=None,
            target_context=target_context,
            entry_point=target_context.get_executable(library, description, environment),
            signature=signature,
            objectmode=False,
            lifted=(),
            fndesc=description,
            library=library,
            environment=environment,
            reload_init=[],
            metadata={},
        )

    def save_overload(self, sig: Any, data: Any) -> None:
        """Give the kernel its own symbol and module, and keep them."""
        symbol = self._symbol(sig)
        if symbol is None:
            return
        module = data.library._final_module
        for part in _own_parts(data.library):
            module.link_in(part, preserve=True)
        module.get_function(data.fndesc.mangled_name).name = symbol
        for thing in [*module.functions, *module.global_variables]:
            if not thing.is_declaration and thing.name != symbol:
                thing.linkage = "internal"
        optimizing.simplify(module)
        data.library.symbol = symbol
        data.fndesc.mangled_name = symbol
        data.fndesc.env_name = f"{symbol}.env"
        data.fndesc.typemap = data.fndesc.calltypes = None
        _modules[symbol] = module
        kept = pickle.dumps((data.signature, data.fndesc, module.as_bitcode()))
        with suppress(OSError):  # then it is translated again next time
            cache.store(*_name_and_key(symbol), cache.TRANSLATION, kept, places)

    def enable(self) -> None:
        """Required by Numba."""

    def disable(self) -> None:
        """Required by Numba."""

    def flush(self) -> None:
        """Required by Numba."""

    def _symbol(self, signature: Any) -> str | None:
        """Of the kernel for these arguments; None if they are functions, whose types have no fixed names."""
        arguments = tuple(getattr(signature, "args", signature))
        if any(isinstance(argument, types.Callable) for argument in arguments):
            return None
        key = kernel_key(self._function, str(arguments))
        name = f"kernel.{self._function.__name__}.{key}"
        return f"_ZN{len(name)}{name}E"


def reachable(symbol: str) -> list[Any]:
    """LLVM modules of a kernel and of all that it calls."""
    found: dict[str, Any] = {}
    waiting = [symbol]
    while waiting:
        each = waiting.pop()
        if each not in found:
            found[each] = _modules[each]
            waiting.extend(_called(found[each]))
    return list(found.values())


def _called(module: Any) -> list[str]:
    """Symbols of the kernels that a module calls."""
    return [f.name for f in module.functions if f.is_declaration and _SYMBOL.fullmatch(f.name)]


def _name_and_key(symbol: str) -> tuple[str, str]:
    match = _SYMBOL.fullmatch(symbol)
    assert match is not None
    return match[1], match[2]


def _load(symbol: str) -> tuple[Any, Any] | None:
    """Signature and descriptor of a kernel in the cache, if all that it calls is there, too."""
    name, key = _name_and_key(symbol)
    file = cache.find(name, key, places, [cache.TRANSLATION])
    if file is None:
        return None
    signature, description, code = pickle.loads(cache.code_of(file))
    module = llvm.parse_bitcode(code)
    if not all(called in _modules or _load(called) for called in _called(module)):
        return None
    _modules[symbol] = module
    return signature, description


def _own_parts(library: Collected) -> list[Any]:
    """LLVM modules of what a kernel calls that is no kernel: Numba's own functions."""
    found: dict[int, Any] = {id(library): None}
    waiting = list(library._linking_libraries)
    while waiting:
        each = waiting.pop()
        if isinstance(each, Collected) and not each.symbol and id(each) not in found:
            found[id(each)] = each._final_module
            waiting.extend(each._linking_libraries)
    return [module for module in found.values() if module is not None]
