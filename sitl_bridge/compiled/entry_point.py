"""Compiled functions that Python calls."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.compiled import machine_code
from sitl_bridge.compiled.marks import Buffer, Declaration, Scalar


def entry_point(
    *arguments: Buffer | Scalar, returns: Scalar = int
) -> Callable[[Callable[..., Any]], EntryPoint]:
    """Mark a function that Python calls: a `Buffer` for each array first, then `int` or `float` a scalar."""
    return lambda function: EntryPoint(function, arguments, returns)


class EntryPoint(Declaration):
    """A compiled function; loaded, and compiled if need be, when it is first bound or called."""

    _function: Any = None

    def bind(self, *arrays: NDArray[Any]) -> Callable[..., Any]:
        """Fix the array arguments; the result takes the scalars and costs little to call.

        Raises TypeError for an array of another type, shape or layout than declared, or that is read-only.
        """
        if len(arrays) != self.buffers:
            raise TypeError(f"{self.name}: {len(arrays)} arrays, expected {self.buffers}")
        addresses = [self._address(index, array) for index, array in enumerate(arrays)]
        return _bound(self._load(), addresses, arrays, self._scalars())

    def __call__(self, *arguments: Any) -> Any:
        """Call with arrays and scalars; convenient, not fast."""
        return self.bind(*arguments[: self.buffers])(*arguments[self.buffers :])

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
            address = machine_code.of_module(module).address(self.symbol)
            if not address:  # calling it would crash
                raise RuntimeError(f"{module} has no entry point {self.name} at module level")
            result = ctypes.c_int64 if self.returns is int else ctypes.c_double
            self._function = ctypes.CFUNCTYPE(result)(address)
        return self._function


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
