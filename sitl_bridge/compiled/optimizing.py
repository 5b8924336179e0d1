"""From LLVM modules to an object file."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from typing import Any

import llvmlite.binding as llvm

from sitl_bridge.compiled.marks import Declaration

RAISED = "sitl_bridge_raised"
"""C function that is called where a compiled function raises; it exists nowhere."""
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
_MOST_ROUNDS = 3
"""A further one knows that what was not inlined does not raise, and drops what would be done then."""


@functools.cache
def _target() -> Any:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=3,
        reloc="pic",
        codemodel="default",
    )


def optimized(entry: Declaration, modules: Sequence[Any]) -> Any:
    """One LLVM module of an entry point, in which nothing else is visible or left undefined.

    Raises RuntimeError for a function that allocates or raises.
    """
    whole = llvm.parse_assembly("")
    for module in modules:
        whole.link_in(module, preserve=True)
    for thing in [*whole.functions, *whole.global_variables]:
        if not thing.is_declaration and thing.name != entry.symbol:
            thing.linkage = "internal"
    for _ in range(_MOST_ROUNDS):
        _run_passes(whole, level=3)
        missing = {f.name for f in whole.functions if f.is_declaration and not f.name.startswith("llvm.")}
        forbidden = missing - _LIBM - _MEMORY
        if not forbidden:
            return whole
    if RAISED in forbidden:
        raise RuntimeError(f"{entry.name} may raise an exception")
    raise RuntimeError(f"{entry.name} needs {', '.join(sorted(forbidden))}, which compiled code has not")


def simplify(kernel: Any) -> None:
    """Shorten the LLVM module of one kernel, once for all entry points that call it."""
    _run_passes(kernel, level=2)


def _run_passes(module: Any, level: int) -> None:
    passes = llvm.create_pass_builder(_target(), llvm.create_pipeline_tuning_options(speed_level=level))
    passes.getModulePassManager().run(module, passes)


def object_code(parts: Iterable[Any]) -> bytes:
    """Object file of optimised LLVM modules."""
    whole = llvm.parse_assembly("")
    for part in parts:
        whole.link_in(part)
    return bytes(_target().emit_object(whole))
