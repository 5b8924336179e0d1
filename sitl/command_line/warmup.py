"""`sitl warmup`: its arguments, and what it does."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from sitl.exit_codes import FAILED


def add_warmup(commands: Any) -> None:
    """Add the command to the command line; it takes no arguments."""
    commands.add_parser(
        "warmup",
        help="compile all machine code now, so that no flight has to",
        description="Compile what flies into the user's cache: $XDG_CACHE_HOME/sitl-bridge, or "
        "~/.cache/sitl-bridge. What is there already is not compiled again. Without this command the first "
        "flight compiles what it needs.",
    )


def run_warmup(_: argparse.Namespace) -> int:
    """Compile what is missing; returns the exit code."""
    from sitl.warmup import warm_up

    try:
        compiled = warm_up()
    except RuntimeError as error:
        print(f"sitl warmup: {error}", file=sys.stderr)
        return FAILED
    if not compiled:
        print("nothing to compile", file=sys.stderr)
    return 0
