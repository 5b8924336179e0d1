"""`sitl doctor`: its arguments, and what it does."""

from __future__ import annotations

import argparse
from typing import Any

from sitl.exit_codes import FAILED


def add_doctor(commands: Any) -> None:
    """Add the command to the command line."""
    parser = commands.add_parser(
        "doctor",
        help="check this machine and installation, and say what to do",
        description="Check Python, packages, cache, clock, cores, ports, display: one line each, with what "
        "to do. Exit code 1 when something prevents a flight.",
    )
    parser.add_argument("--json", action="store_true", help="one JSON array on standard output")


def run_doctor(arguments: argparse.Namespace) -> int:
    """Examine; exit code 1 when something prevents a flight."""
    from sitl.doctor.run import examine

    return 0 if examine(arguments.json) else FAILED
