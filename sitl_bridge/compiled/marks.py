"""Marks of what is compiled. The functions themselves stay plain Python."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

KERNEL = "kernel"
VECTOR_KERNEL = "vector kernel"
_MARK = "__compiled_as__"

Function = TypeVar("Function", bound=Callable[..., Any])
Scalar = type[int] | type[float]


class Buffer(NamedTuple):
    """An array argument: C-contiguous, of this type and shape."""

    dtype: Any
    shape: tuple[int, ...]


def kernel(function: Function) -> Function:
    """Mark a function that compiled code calls."""
    function.__dict__[_MARK] = KERNEL
    return function


def vector_kernel(function: Function) -> Function:
    """Mark a kernel whose sums may be taken in any order, so that one instruction works on several terms."""
    function.__dict__[_MARK] = VECTOR_KERNEL
    return function


def mark_of(function: Callable[..., Any]) -> str | None:
    """`KERNEL`, `VECTOR_KERNEL`, or None for a function that is not compiled."""
    mark: str | None = function.__dict__.get(_MARK)
    return mark


class Declaration:
    """A function that Python calls compiled: its arrays first, then its scalars."""

    def __init__(self, function: Callable[..., Any], arguments: tuple[Any, ...], returns: Scalar) -> None:
        self.python = kernel(function)
        """The same function, uncompiled; for other compiled functions to call, as a kernel."""
        self.__doc__ = function.__doc__
        self.name = function.__name__
        self.arguments = arguments
        self.returns = returns
        self.buffers = sum(isinstance(argument, Buffer) for argument in arguments)
        """How many of the arguments are arrays."""

    @property
    def symbol(self) -> str:
        """Name of the C function: of a pointer to a table of addresses.

        The table has the addresses of the arrays, then that of the scalars, eight bytes each.
        """
        return f"{self.python.__module__}.{self.name}".replace(".", "_")


def declarations(module: str) -> dict[str, Declaration]:
    """What an imported module declares, by name."""
    values = list(vars(sys.modules[module]).values()) if module in sys.modules else []
    return {v.name: v for v in values if isinstance(v, Declaration) and v.python.__module__ == module}


def declaring_modules() -> list[str]:
    """The imported modules that declare something, in the order in which they were imported."""
    return [module for module in list(sys.modules) if declarations(module)]
