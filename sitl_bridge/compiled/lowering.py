"""From marked Python functions to LLVM modules, by Numba.

Numba usually optimises and loads each function with all that it calls, again and again on the way up. Here
its library class only collects: one LLVM module for each kernel, as it was translated. What Numba is asked
for beyond its public interface is all in this file and in `kernels`.
"""

from __future__ import annotations

import functools
from types import FunctionType
from typing import Any

import llvmlite.binding as llvm
import numba
import numpy as np
from llvmlite import ir
from numba.core import codegen, types
from numba.core.registry import cpu_target
from numba.extending import typeof_impl
from numba.np import arrayobj

from sitl_bridge.compiled import kernels
from sitl_bridge.compiled.marks import VECTOR_KERNEL, Buffer, Declaration, mark_of
from sitl_bridge.compiled.optimizing import RAISED

_ALLOCATES = ("NRT required", "Only accept returning of array passed into the function")
"""In what Numba says about a function that allocates."""
_POINTER = ir.IntType(8).as_pointer()
_INT64 = ir.IntType(64)


class _Collecting(codegen.JITCPUCodegen):  # type: ignore[misc]  # Numba has no types
    """Code generation that loads nothing."""

    _library_class = kernels.Collected

    def set_env(self, env_name: str, env: Any) -> None:
        pass


@functools.cache
def _context() -> Any:
    context = cpu_target.target_context
    cpu_target.typing_context.refresh()
    context.refresh()
    context._internal_codegen = _Collecting("sitl_bridge")
    return context


@functools.cache
def _dispatcher(function: FunctionType) -> Any:
    """Numba's own object for a marked function."""
    options: dict[str, Any] = {"fastmath": {"reassoc"}} if mark_of(function) == VECTOR_KERNEL else {}
    dispatcher = numba.njit(
        error_model="numpy", _nrt=False, no_cpython_wrapper=True, no_cfunc_wrapper=True, **options
    )(function)
    dispatcher._cache = kernels.KernelCache(function)
    return dispatcher


@typeof_impl.register(FunctionType)  # type: ignore[untyped-decorator]  # Numba has no types
def _type_of_function(function: FunctionType, _: Any) -> Any:
    """What Numba makes of a global name: a marked function is one that can be called."""
    return types.Dispatcher(_dispatcher(function)) if mark_of(function) else None


def modules(entry: Declaration) -> list[Any]:
    """LLVM modules of an entry point: of its C function first, then of all that it calls.

    Raises RuntimeError for a function that allocates.
    """
    context = _context()
    arguments = tuple(_type(argument) for argument in entry.arguments)
    dispatcher = _dispatcher(entry.python)
    try:
        dispatcher.compile(arguments)
    except numba.core.errors.NumbaError as error:
        if any(sign in str(error) for sign in _ALLOCATES):
            text = "allocates memory, or a kernel that it calls returns an array which is no argument"
            raise RuntimeError(f"{entry.name} {text}:\n{error}") from None
        raise
    result = dispatcher.overloads[arguments]
    return [_c_function(entry, context, result.fndesc), *kernels.reachable(result.fndesc.llvm_func_name)]


def _type(argument: Any) -> Any:
    """Numba's type of an argument."""
    if isinstance(argument, Buffer):
        return types.Array(numba.from_dtype(np.dtype(argument.dtype)), len(argument.shape), "C")
    return types.int64 if argument is int else types.float64


def _c_function(entry: Declaration, context: Any, callee: Any) -> Any:
    """LLVM module of the C function that takes the arguments from a table of addresses and calls."""
    module = context.create_module(entry.symbol)
    result = types.int64 if entry.returns is int else types.float64
    function_type = ir.FunctionType(context.get_value_type(result), [_POINTER.as_pointer()])
    function = ir.Function(module, function_type, entry.symbol)
    builder = ir.IRBuilder(function.append_basic_block("entry"))
    addresses = [
        builder.load(builder.gep(function.args[0], [_INT64(index)])) for index in range(entry.buffers + 1)
    ]
    values = []
    for index, argument in enumerate(entry.arguments):
        if isinstance(argument, Buffer):
            values.append(_array(context, builder, argument, addresses[index]))
        else:
            pointer = context.get_value_type(_type(argument)).as_pointer()
            scalars = builder.bitcast(addresses[entry.buffers], pointer)
            values.append(builder.load(builder.gep(scalars, [_INT64(index - entry.buffers)])))
    target_type = context.call_conv.get_function_type(callee.restype, callee.argtypes)
    target = ir.Function(module, target_type, callee.llvm_func_name)
    status, value = context.call_conv.call_function(builder, target, callee.restype, callee.argtypes, values)
    with builder.if_then(status.is_error, likely=False):
        builder.call(ir.Function(module, ir.FunctionType(ir.VoidType(), []), RAISED), [])
    builder.ret(context.cast(builder, value, callee.restype, result))
    return llvm.parse_assembly(str(module))


def _array(context: Any, builder: Any, buffer: Buffer, address: Any) -> Any:
    """Numba's value of an array at an address."""
    item = np.dtype(buffer.dtype).itemsize
    steps = [item * int(np.prod(buffer.shape[axis + 1 :], dtype=int)) for axis in range(len(buffer.shape))]
    array = context.make_array(_type(buffer))(context, builder)
    arrayobj.populate_array(
        array,
        data=builder.bitcast(address, array.data.type),
        shape=[_INT64(length) for length in buffer.shape],
        strides=[_INT64(step) for step in steps],
        itemsize=_INT64(item),
        meminfo=None,
    )
    return array._getvalue()
