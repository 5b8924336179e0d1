"""`sitl vehicle new|check|list`: a vehicle of one's own."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from sitl.command_line.argument_types import number
from sitl.exit_codes import FAILED
from sitl_bridge.vehicle.files import DescriptionError, load_vehicle, vehicle_names


def add_vehicle(commands: Any) -> None:
    """Add the command with its three parts to the command line."""
    from sitl.vehicles.sketch import Sketch
    from sitl_bridge.vehicle.errors import comment_of

    parser = commands.add_parser(
        "vehicle",
        help="make a vehicle of one's own, or say what follows from one",
        description="Make a vehicle's file from a few figures, or say what follows from one.",
    )
    parts = parser.add_subparsers(dest="part", required=True, metavar="new|check|list")
    new = parts.add_parser(
        "new",
        help="write the file of a vehicle from a few figures",
        description="Write a commented TOML from a few figures of a data sheet; what is not given follows "
        "from rules of thumb (docs/your-own-vehicle.md). Without --mass it asks. The file is valid, and the "
        "default law flies it, or it is refused with the reason.",
    )
    new.add_argument(
        "file", metavar="FILE", nargs="?", type=Path, help="the file to write (default: standard output)"
    )
    new.add_argument("--out", metavar="FILE", type=Path, help="the same as FILE")
    for key in Sketch.model_fields:
        if key != "stretch_share":
            flag = f"--{key.replace('_', '-')}"
            new.add_argument(flag, metavar=_metavar(key), help=comment_of(Sketch, key).replace("%", "%%"))
    new.add_argument("--force", action="store_true", help="overwrite a file that there is")

    check = parts.add_parser(
        "check",
        help="say what follows from a vehicle, and fly a step with it",
        description="Say what follows from a vehicle's description, and fly a step with it in this process. "
        "Exit code 0: the default law flies it; 1: it does not; 2: the description is faulty.",
    )
    check.add_argument("vehicle", metavar="NAME|FILE", help="a shipped vehicle's name, or a .toml file")
    check.add_argument(
        "--set", metavar="KEY=VALUE", action="append", default=[], help="override one value (repeatable)"
    )
    check.add_argument(
        "--step", metavar="M", type=number(0.01, 1000, "metres"), default=1.0, help="length (default: 1)"
    )
    check.add_argument(
        "--feedback",
        choices=("truth", "estimate"),
        default="truth",
        help="what the law flies on (default: %(default)s)",
    )
    check.add_argument(
        "--rate",
        metavar="HZ",
        type=number(20, 1000, "ticks a second"),
        default=250.0,
        help="ticks a second (default: 250)",
    )
    check.add_argument("--json", action="store_true", help="one JSON object on standard output")
    names = parts.add_parser("list", help="list the vehicles that come with the package")
    names.add_argument("--json", action="store_true", help="one JSON array on standard output")


def run_vehicle(arguments: argparse.Namespace) -> int:
    """Do what the part says; returns the exit code."""
    return {"new": _new, "check": _check, "list": _list}[arguments.part](arguments)


def _metavar(key: str) -> str:
    from sitl.vehicles.sketch import Sketch
    from sitl_bridge.vehicle.errors import unit_of

    return unit_of(Sketch.model_fields[key]).upper() or ("NAME" if key in ("name", "sensors") else "X")


def _new(arguments: argparse.Namespace) -> int:
    from controller.design.feasibility import vehicle_faults
    from sitl.vehicles.ask import ask, parsed
    from sitl.vehicles.commented import toml_text
    from sitl.vehicles.sketch import Sketch, described
    from sitl_bridge.vehicle.description import Vehicle
    from sitl_bridge.vehicle.files import completed, validated

    file: Path | None = arguments.out or arguments.file
    if file is not None and file.exists() and not arguments.force:
        raise DescriptionError(str(file), ["exists already; expected another file, or --force"])
    given = dict(
        parsed(key, text)
        for key in Sketch.model_fields
        if (text := getattr(arguments, key, None)) is not None
    )
    if "mass" not in given:
        try:
            given = ask(given, _read, _say)
        except EOFError:
            raise DescriptionError("--mass", ["missing; expected kg, or answers on standard input"]) from None
    sketch = validated(Sketch, given, "sitl vehicle new", _flag)
    content = described(sketch)
    vehicle = validated(Vehicle, completed(content), sketch.name)
    if reasons := vehicle_faults(vehicle):
        raise DescriptionError(f"{sketch.name} would not fly", reasons)
    text = toml_text(content, f"Made by `sitl vehicle new` from {_said(given)}.")
    if file is None:
        print(text, end="")
        return 0
    file.write_text(text, encoding="utf-8")
    print(f"{file}: {vehicle.description}", file=sys.stderr)
    return 0


def _say(line: str) -> None:
    print(line, file=sys.stderr)


def _read(question: str) -> str:
    """Ask where the file that goes to standard output is not disturbed."""
    print(question, end="", file=sys.stderr, flush=True)
    line = sys.stdin.readline()
    if not line:
        raise EOFError
    return line


def _said(given: dict[str, Any]) -> str:
    return ", ".join(f"{key} {value}" for key, value in given.items()).replace("_", " ")


def _flag(location: tuple[int | str, ...]) -> str:
    """Of a fault of one figure."""
    return f"--{str(location[0]).replace('_', '-')}" if location else ""


def _check(arguments: argparse.Namespace) -> int:
    from sitl.vehicles.check import check, table

    vehicle = load_vehicle(arguments.vehicle, arguments.set)
    checked = check(vehicle, arguments.rate, arguments.step, arguments.feedback)
    print(json.dumps(checked.as_json(), indent=2) if arguments.json else table(checked))
    return 0 if checked.flies else FAILED


def _list(arguments: argparse.Namespace) -> int:
    vehicles = {name: load_vehicle(name).description for name in vehicle_names()}
    if arguments.json:
        print(json.dumps([{"name": n, "description": d} for n, d in vehicles.items()], indent=2))
    else:
        print("\n".join(f"{name:<10}{description}" for name, description in vehicles.items()))
    return 0
