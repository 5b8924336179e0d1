"""The process that compiles: each kernel is translated once, for all modules that it is asked for.

One line of JSON for each module goes to standard output, as soon as its machine code is in the cache: key,
file, and the reason if there is none.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import sys
import traceback
from collections.abc import Iterable
from pathlib import Path

from sitl_bridge.compiled import cache, linking
from sitl_bridge.compiled.key import key_of
from sitl_bridge.compiled.marks import Declaration, declarations


def main() -> None:
    """Compile the modules that the command line names, into the first place that takes them."""
    gc.disable()  # the compiler's data are many and stay: looking through them is a tenth of the work
    output = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever else is printed is none of the answer
    work = json.loads(sys.argv[1])
    places = [Path(place) for place in work["places"]]
    for module in work["modules"]:
        try:
            key, file = build(module, places)
            answer = (key, str(file), "")
        except Exception:
            answer = ("", "", traceback.format_exc())
        try:
            print(json.dumps(answer), file=output, flush=True)
        except BrokenPipeError:
            os._exit(1)  # whoever asked is gone


def build(module: str, places: list[Path]) -> tuple[str, Path]:
    """Compile a module, unless another process has done so; returns its key and the file of machine code."""
    importlib.import_module(module)
    entries = declarations(module)
    key = key_of(entries)
    with cache.locked(module, places):
        file = cache.find(module, key, places)
        if file is None:
            kind, code = linking.linked(_object_code(entries.values()))
            file = cache.store(module, key, kind, code, places)
    return key, file


def _object_code(entries: Iterable[Declaration]) -> bytes:
    """Object file of a module's entry points."""
    from sitl_bridge.compiled import lowering, optimizing

    parts = [optimizing.optimized(entry, lowering.modules(entry)) for entry in entries]
    return optimizing.object_code(parts)
