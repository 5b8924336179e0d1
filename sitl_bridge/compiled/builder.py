"""The process that compiles: it translates each kernel once, for all modules that it is asked for.

While the next module is translated, a process of its own optimises, links and stores the last one. Lines of
JSON go to standard output: `[module]` when it is begun, `[module, key, file, failure]` when it is done.
"""

from __future__ import annotations

import gc
import importlib
import json
import multiprocessing
import os
import sys
import traceback
from collections.abc import Callable, Iterable, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

from sitl_bridge.compiled import cache, linking
from sitl_bridge.compiled.key import key_of
from sitl_bridge.compiled.marks import Declaration, declarations

_MOST_AT_ONCE = os.cpu_count() or 1


class Answer(NamedTuple):
    """What became of a module."""

    module: str
    key: str = ""
    file: str = ""
    failure: str = ""


def main() -> None:
    """Compile the modules that the command line names, into the first place that takes them."""
    gc.disable()  # the compiler's data are many and stay: looking through them is a tenth of the work
    output = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever else is printed is none of the answer
    work = json.loads(sys.argv[1])

    def tell(line: Sequence[str]) -> None:
        try:
            print(json.dumps(line), file=output, flush=True)
        except BrokenPipeError:
            os._exit(1)  # whoever asked is gone

    build(work["modules"], [Path(place) for place in work["places"]], tell)


def build(modules: Iterable[str], places: list[Path], tell: Callable[[Sequence[str]], None]) -> None:
    """Compile modules and tell of each, as described above."""
    under_way: list[_Finish] = []
    for module in modules:
        tell([module])
        try:
            step = _begin(module, places)
        except Exception:
            step = Answer(module, failure=traceback.format_exc())
        if isinstance(step, Answer):
            tell(step)
        else:
            under_way.append(step)
        while len(under_way) >= _MOST_AT_ONCE or (under_way and under_way[0].is_done()):
            tell(under_way.pop(0).answer())
    for finish in under_way:
        tell(finish.answer())
    cache.forget_unused(places)


def _begin(module: str, places: list[Path]) -> Answer | _Finish:
    """Translate a module, unless another process has compiled it."""
    importlib.import_module(module)
    entries = declarations(module)
    key = key_of(entries)
    with cache.locked(module, places):  # the process that is started here holds the lock, too, until it ends
        if file := cache.find(module, key, places):
            return Answer(module, key, str(file))
        from sitl_bridge.compiled import kernels, lowering

        kernels.places = places
        translated = [(entry, lowering.modules(entry)) for entry in entries.values()]
        return _Finish(module, key, translated, places)


class _Finish:
    """A process that makes machine code of what is translated."""

    def __init__(
        self, module: str, key: str, translated: list[tuple[Declaration, Any]], places: list[Path]
    ) -> None:
        self._module = module
        context = multiprocessing.get_context("fork")
        self._results, results = context.Pipe(duplex=False)
        work = (results, module, key, translated, places)
        self._process = context.Process(target=_finish, args=work)
        self._process.start()
        results.close()

    def is_done(self) -> bool:
        """Whether the answer can be had without waiting."""
        return self._results.poll()

    def answer(self) -> Answer:
        """Wait for the process."""
        try:
            answer: Answer = self._results.recv()
        except EOFError:
            self._process.join()
            return Answer(self._module, failure=f"ended with exit code {self._process.exitcode}")
        self._process.join()
        return answer


def _finish(
    results: Connection, module: str, key: str, translated: list[tuple[Declaration, Any]], places: list[Path]
) -> None:
    from sitl_bridge.compiled import optimizing

    try:
        parts = [optimizing.optimized(entry, modules) for entry, modules in translated]
        kind, code = linking.linked(optimizing.object_code(parts))
        answer = Answer(module, key, str(cache.store(module, key, kind, code, places)))
    except Exception:
        answer = Answer(module, failure=traceback.format_exc())
    results.send(answer)
