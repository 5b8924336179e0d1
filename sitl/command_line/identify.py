"""`sitl identify`: measure how a flight stack follows its set-points."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from sitl.command_line.argument_types import number
from sitl.exit_codes import FAILED
from sitl_bridge.process import Speaker, StopRequest
from sitl_bridge.vehicle.files import DescriptionError, load_vehicle

DEFAULT_DURATION = 50.0
"""s of sines: the first ten settle."""
NOT_TO_IDENTIFY = (
    ("steer", "rates", "it measures how body rates are followed"),
    ("baseline", None, "the law flies"),
)
"""Flags of a companion that mean nothing here: usual value, and why."""
Group = Callable[[argparse.ArgumentParser], None]


def add_identify(commands: Any, groups: tuple[Group, ...]) -> None:
    """The command's flags; groups: those that it shares with others."""
    parser = commands.add_parser(
        "identify",
        help="measure how a flight stack follows, for --stack",
        description="Arm a flight stack, take off, and measure in a minute of gentle flight how it follows "
        "body rates and thrust: lag, delay, thrust curve. Write a file for `--over ADDRESS --stack FILE`. "
        "The load hangs from the vehicle, with room to swing by half a metre.",
    )
    for add in groups:
        add(parser)
    parser.add_argument(
        "--duration",
        metavar="S",
        type=number(30, 600, "seconds"),
        default=DEFAULT_DURATION,
        help="of the sines (default: %(default)g)",
    )
    parser.add_argument(
        "--out", metavar="FILE", type=Path, default=Path("stack.toml"), help="(default: %(default)s)"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output at the end")


def run_identify(arguments: argparse.Namespace) -> int:
    """Measure, and write the file; exit code 1 when nothing was found."""
    from controller.over.identify.probe import Probe
    from controller.over.run import run
    from controller.over.stack import stack_text
    from sitl.command_line.over import over_options
    from sitl.flights.scenario import Hover

    if arguments.over is None:
        raise DescriptionError("--over", ["no stack; expected its address, as in udpin:127.0.0.1:14540"])
    for name, usual, why in NOT_TO_IDENTIFY:
        if getattr(arguments, name) != usual:
            raise DescriptionError(f"--{name}", [f"does not go with identify: {why}"])
    overrides = [] if arguments.sensors is None else [f"sensors.preset={arguments.sensors}"]
    vehicle = load_vehicle(arguments.vehicle or "iris", [*overrides, *arguments.set])
    options = over_options(arguments, vehicle, Hover(kind="hover").path, arguments.duration)
    probe = Probe(vehicle, options.stack.kind)
    stop = StopRequest()
    stop.install()
    outcome = run(replace(options, out=None, probe=probe), Speaker("identify", events=False), stop)
    if not outcome["completed"]:
        return FAILED
    try:
        found = probe.result()
    except ValueError as error:
        print(f"identify: {error}", file=sys.stderr)
        return FAILED
    remarks = [f"How a flight stack follows, measured with {vehicle.name} by `sitl identify`."]
    remarks += [
        f"{name}: lag {r.lag:.4f} s, delay {r.delay:.4f} s, {r.misfit:.0%} misfit"
        for name, r in found.responses.items()
    ]
    text = stack_text(found.stack, remarks)
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text(text, encoding="utf-8")
    if arguments.json:
        responses = {name: r._asdict() for name, r in found.responses.items()}
        print(json.dumps({**found.stack.model_dump(), "responses": responses}, indent=2))
    else:
        print(text, end="")
        print(f"  {arguments.out}")
    return 0
