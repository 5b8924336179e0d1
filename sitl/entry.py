"""Starts the `sitl` command quickly: what has to be settled before the first import of any weight."""

from __future__ import annotations

import gc
import os
import signal
import sys

from sitl.exit_codes import FAILED, INTERRUPTED, USAGE


def main() -> int:
    """Run the command line; returns the exit code."""
    # Also where it was inherited as ignored. A command that has more to do at Ctrl-C sets its own.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return _command()
    except KeyboardInterrupt:
        print("sitl: interrupted", file=sys.stderr)
        return INTERRUPTED


def _command() -> int:
    # Matrices here are of 20 rows: threads of a linear algebra library only wait, and spin while they do.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # What imports build stays; looking through it for garbage again and again is a tenth of the start.
    gc.disable()
    try:
        from sitl.command_line import commands
    except ModuleNotFoundError as error:
        return _without(error)
    gc.freeze()
    gc.enable()
    return commands.main()


def _without(error: ModuleNotFoundError) -> int:
    """A required package is missing: only `sitl doctor` works."""
    if sys.argv[1:2] != ["doctor"]:
        print(f"sitl: {error.msg}; `{sys.executable} -m sitl doctor` says what to install", file=sys.stderr)
        return USAGE
    from sitl.doctor.run import examine

    examine("--json" in sys.argv)
    print(f"sitl: {error.msg}", file=sys.stderr)
    return FAILED
