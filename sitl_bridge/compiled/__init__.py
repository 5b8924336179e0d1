"""Machine code for the functions that run at every tick.

In: Python functions, marked by decorators. Out: callables of fixed arrays, which cost less than a microsecond
a call. Imports nothing else of this product; Numba and llvmlite only in the process that compiles.

- `marks`: `@kernel` and `@vector_kernel`, functions that other compiled functions call.
- `entry_point`: `@entry_point(...)`, functions that Python calls. `entry.bind(arrays…)` gives a callable that
  takes the scalars.
- `key`: a digest of all that decides the machine code, and of nothing else.
- `cache`: files of machine code, by key, in a directory of the user's that all checkouts share.
- `machine_code`: loads such a file through ctypes, or has it compiled.
- `request`: starts the process that compiles and says how far it is.
- `builder`, `lowering`, `kernels`, `optimizing`, `linking`: that process. Numba translates each kernel once,
  LLVM optimises each entry point as a whole, a linker makes a shared library of each module.

Compiled code neither allocates nor raises, and a kernel returns no array but an argument; the build refuses a
function that would. Uncompiled, the marked functions are plain Python: tests differentiate them with complex
numbers, and a debugger steps through them.
"""

from sitl_bridge.compiled.entry_point import EntryPoint, entry_point
from sitl_bridge.compiled.machine_code import compile_missing, load, missing
from sitl_bridge.compiled.marks import Buffer, kernel, vector_kernel

__all__ = [
    "Buffer",
    "EntryPoint",
    "compile_missing",
    "entry_point",
    "kernel",
    "load",
    "missing",
    "vector_kernel",
]
