"""Has modules compiled by a process of its own, and says how far it is."""

from __future__ import annotations

import atexit
import functools
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO, NamedTuple

from sitl_bridge.compiled import cache

COMPILING = "SITL_BRIDGE_COMPILING"
"""Set in the environment of the process that compiles."""
INTERRUPTED = {-signal.SIGINT, -signal.SIGTERM, -signal.SIGHUP}

Say = Callable[[int, int, str], None]
"""Takes the number of a module that is about to be compiled, of how many, and its name."""


def say(number: int, total: int, module: str) -> None:
    """Tell on standard error what is about to be compiled."""
    print(f"compiling {number} of {total}: {module}", file=sys.stderr, flush=True)


class Outcome(NamedTuple):
    """What became of one module: a file of machine code, or the reason why there is none."""

    file: Path | None = None
    failure: str = ""


def compile_modules(keys: Mapping[str, str], say: Say) -> dict[str, Outcome]:
    """Compile modules, given with their keys.

    Each is in the cache as soon as it is done: who is stopped loses only the one under way. Raises
    KeyboardInterrupt if the process that compiles is interrupted, RuntimeError if it ends otherwise.
    """
    if os.environ.get(COMPILING):
        raise RuntimeError(f"an entry point of {next(iter(keys))} is called while a module is imported")
    places = [place for place in cache.directories() if cache.takes_files(place)]
    last_resort = [] if places else [_private_directory()]
    outcomes: dict[str, Outcome] = {}
    with tempfile.TemporaryFile() as complaints, _builder(keys, places + last_resort, complaints) as process:
        assert process.stdout is not None
        module, begun = next(iter(keys)), 0
        try:
            for line in process.stdout:
                module, *result = json.loads(line)
                if result:
                    outcomes[module] = _outcome(module, keys[module], *result)
                else:
                    begun += 1
                    say(begun, len(keys), module)
        except BaseException:
            process.kill()
            raise
        if len(outcomes) < len(keys):
            status = process.wait()
            complaints.seek(0)
            raise _end(module, status, complaints.read().decode(errors="replace"))
    if last_resort:
        text = f"no place to keep the compiled {', '.join(keys)}: each start compiles it"
        print(text, file=sys.stderr, flush=True)
    return outcomes


def _builder(keys: Mapping[str, str], places: list[Path], complaints: IO[bytes]) -> subprocess.Popen[str]:
    """The process that compiles; see `builder` for what it writes."""
    work = json.dumps({"modules": list(keys), "places": [str(place) for place in places]})
    # The same path as here and, with -P, nothing in front of it; NUMBA_… would change what is compiled.
    command = [sys.executable, "-P", "-c", f"from {__package__}.builder import main; main()", work]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    environment |= {COMPILING: "1", "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}
    return subprocess.Popen(
        command,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=complaints,
        text=True,
    )


def _outcome(module: str, wanted: str, key: str, file: str, failure: str) -> Outcome:
    if failure:
        return Outcome(failure=f"compiling {module} failed:\n{failure}")
    if key != wanted:
        return Outcome(failure=f"compiling {module} failed: its sources changed meanwhile")
    return Outcome(Path(file))


def _end(module: str, status: int, complaint: str) -> BaseException:
    """Why the process that compiles ended before it was done."""
    if status in INTERRUPTED:
        return KeyboardInterrupt()  # whoever stopped that meant this process as well
    if status < 0:
        return RuntimeError(f"compiling {module} was killed by {signal.Signals(-status).name}")
    return RuntimeError(f"compiling {module} failed:\n{complaint}")


@functools.cache
def _private_directory() -> Path:
    """For machine code that can be kept nowhere; it is deleted when this process ends."""
    directory = Path(tempfile.mkdtemp(prefix="sitl-bridge-"))
    atexit.register(shutil.rmtree, directory, ignore_errors=True)
    return directory
