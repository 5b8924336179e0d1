"""`sitl view`: a flight in the browser, live or afterwards."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from sitl.command_line.argument_types import whole
from sitl.exit_codes import USAGE
from sitl_bridge.process import StopRequest

DEFAULT_SOURCE = "udpin:127.0.0.1:14550"


def add_view(commands: Any) -> None:
    """Add the command to the `sitl` command's parsers."""
    parser = commands.add_parser(
        "view",
        help="show a flight in the browser, live or afterwards",
        description="Show a vehicle that speaks MAVLink, or a finished flight, as a 3-D picture in the "
        "browser. Needs the extra [view] (viser).",
    )
    parser.add_argument(
        "sources",
        metavar="SOURCE",
        nargs="*",
        default=[DEFAULT_SOURCE],
        help="links to listen on (udpin:HOST:PORT, udpout:…, tcpout:…), or the folder of a finished flight, "
        f"or a .tlog (default: {DEFAULT_SOURCE}, where a ground station listens)",
    )
    parser.add_argument(
        "--vehicle", metavar="NAME|FILE", help="what it looks like (default: the flight's, or iris)"
    )
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="override one value of the description",
    )
    parser.add_argument(
        "--scenario",
        metavar="NAME|FILE",
        help="what is flown: draw the way and the set-point of its reference",
    )
    parser.add_argument(
        "--export", metavar="FILE.html", type=Path, help="write a finished flight as one self-contained page"
    )
    parser.add_argument(
        "--port", type=whole(1, 65535, "a port"), default=8080, help="of the page (default: 8080)"
    )
    parser.add_argument(
        "--expose", action="store_true", help="serve the page to the network, not to this machine alone"
    )
    parser.add_argument("--no-browser", action="store_true", help="only print the address")
    parser.add_argument(
        "--until-eof",
        action="store_true",
        help="stop when standard input ends, and write events (for programs)",
    )


def run_view(arguments: argparse.Namespace) -> int:
    """Show until Ctrl-C; exit code 2 for a source that is none."""
    from sitl.recording.recording import RecordingError
    from sitl.view.run import ViewOptions, run
    from sitl_bridge.mavlink.links.address import parse_address

    flights = [Path(source) for source in arguments.sources if Path(source).exists()]
    if flights and len(arguments.sources) > 1:
        return _refuse(f"{flights[0]}: a finished flight is shown alone; expected one source")
    addresses = []
    if not flights:
        for source in arguments.sources:
            try:
                addresses.append(parse_address(source))
            except ValueError as error:
                return _refuse(f"{error}, or the folder or .tlog of a finished flight")
    if arguments.export is not None and not flights:
        return _refuse("--export: goes with the folder or .tlog of a finished flight")
    if arguments.export is not None and not arguments.export.absolute().parent.is_dir():
        return _refuse(f"--export: {arguments.export.parent}: no such folder")
    if arguments.scenario is not None and flights:
        return _refuse("--scenario: goes with links; a finished flight has its own reference")
    options = ViewOptions(
        addresses=addresses,
        flight=flights[0] if flights else None,
        vehicle=arguments.vehicle,
        overrides=arguments.set,
        scenario=arguments.scenario,
        export=arguments.export,
        host="0.0.0.0" if arguments.expose else "127.0.0.1",
        port=arguments.port,
        browser=not arguments.no_browser,
        events=arguments.until_eof,
    )
    stop = StopRequest()
    stop.install(watch_stdin=arguments.until_eof)
    try:
        run(options, stop)
    except RecordingError as error:
        return _refuse(str(error))
    if options.export is not None:
        print(options.export)
    return 0


def _refuse(message: str) -> int:
    print(f"sitl view: {message}", file=sys.stderr)
    return USAGE
