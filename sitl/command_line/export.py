"""`sitl export`: a finished flight in another tool's format."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from sitl.exit_codes import USAGE

FORMATS = ("csv", "mat", "mcap", "ulog")


def add_export(commands: Any) -> None:
    """Add the command to the `sitl` command's parsers."""
    parser = commands.add_parser(
        "export",
        help="write a finished flight for another tool",
        description="Write a finished flight as ULog with PX4's topic names, CSV, MATLAB or MCAP.",
    )
    parser.add_argument("flight", metavar="FLIGHT", type=Path, help="folder that `sitl fly` has left")
    parser.add_argument("--to", choices=FORMATS, required=True, help="format")
    parser.add_argument(
        "--out", metavar="FILE", type=Path, help="file to write (default: flight.… in the flight's folder)"
    )


def run_export(arguments: argparse.Namespace) -> int:
    """Write the file, print its path; exit code 2 for a folder that is not a flight's."""
    from sitl.export.formats import export
    from sitl.recording.recording import RecordingError

    try:
        print(export(arguments.flight, arguments.to, arguments.out))
    except RecordingError as error:
        print(f"sitl export: {error}", file=sys.stderr)
        return USAGE
    return 0
