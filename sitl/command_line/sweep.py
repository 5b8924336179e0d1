"""`sitl sweep`: many flights for one question."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from sitl.command_line.argument_types import whole
from sitl.exit_codes import FAILED, INTERRUPTED
from sitl_bridge.process import StopRequest
from sitl_bridge.vehicle.files import DescriptionError


def add_sweep(commands: Any) -> None:
    """Add the command to the `sitl` command's parsers."""
    parser = commands.add_parser(
        "sweep",
        help="fly a study: many flights over what varies, with verdicts and a page",
        description="Fly a study that a TOML file describes, on Dask's workers. Flights that are in the "
        "output folder already are not flown again. Exit code 1 when a verdict of the study does not hold. "
        "Needs the extra [study].",
    )
    parser.add_argument("study", metavar="STUDY.toml", type=Path, help="what varies, and what has to hold")
    parser.add_argument(
        "--out", metavar="DIR", type=Path, help="dataset and page (default: runs/NAME of the file)"
    )
    parser.add_argument(
        "--workers",
        metavar="N",
        type=whole(1, 1024, "a number"),
        help="processes (default: one for each core)",
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="of a Dask cluster that is there: tcp://HOST:PORT"
    )
    parser.add_argument("--only", metavar="IDENTITY", help="fly one flight of it here, and keep its logs")
    parser.add_argument("--json", action="store_true", help="counts and verdicts as one JSON object")


def run_sweep(arguments: argparse.Namespace) -> int:
    """Fly, judge; exit code 1 when a verdict does not hold."""
    out = arguments.out or Path("runs") / arguments.study.stem
    if arguments.only is not None:
        return _fly_one(arguments.study, arguments.only, out)
    from sitl.studies.sweep.run import SweepOptions, sweep

    stop = StopRequest()
    stop.install()
    swept = sweep(SweepOptions(arguments.study, out, arguments.workers, arguments.scheduler), stop)
    outcomes: dict[str, int] = {}
    for row in swept.rows:
        outcomes[row["outcome"]] = outcomes.get(row["outcome"], 0) + 1
    if arguments.json:
        verdicts = [judged._asdict() for judged in swept.verdicts]
        print(json.dumps({"flights": len(swept.rows), "outcomes": outcomes, "verdicts": verdicts}, indent=2))
    else:
        for outcome, count in sorted(outcomes.items()):
            print(f"  {outcome:<20}{count}")
        for judged in swept.verdicts:
            print(f"  {'holds' if judged.holds else 'DOES NOT HOLD':<14}{judged.text}: {judged.found}")
        print(f"  {swept.page}")
    if stop:
        return INTERRUPTED
    return 0 if swept.holds else FAILED


def _fly_one(file: Path, identity: str, out: Path) -> int:
    from sitl.studies.sweep.draws import draws
    from sitl.studies.sweep.study import load_study
    from sitl.studies.sweep.worker import fly_draw

    study = load_study(file)
    found = next((draw for draw in draws(study) if draw.identity == identity), None)
    if found is None:
        raise DescriptionError("--only", [f"{identity}: no flight of {file}"])
    folder = out / "logs" / identity
    plain = {**study.model_dump(mode="json"), "logs": "all"}
    row = fly_draw(plain, found.inputs, str(folder))
    print(json.dumps({"inputs": found.inputs, **row}, indent=2, default=str))
    print(folder, file=sys.stderr)
    return 0 if row["outcome"] == "settled" else FAILED
