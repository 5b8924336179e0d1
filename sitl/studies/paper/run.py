"""`sitl paper`: runs every experiment of the paper and writes one page and the numbers behind it."""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from sitl.flights.launch import FlightError
from sitl.studies.paper import page
from sitl.studies.paper.context import Context
from sitl.studies.paper.flights import Pilot
from sitl.studies.paper.record import Ledger
from sitl.studies.paper.sections import (
    beyond,
    beyond_starts,
    circling,
    elasticity,
    hover,
    linear,
    lqr_hover,
    model,
    motions,
    position,
    rigid,
    sampling,
)
from sitl_bridge.process import StopRequest

PAGE_NAME = "index.html"
NUMBERS_NAME = "paper.json"

SECTIONS: tuple[tuple[str, Callable[[Context], str]], ...] = (
    ("The model (section II)", model.section),
    ("Hovering (section III)", hover.section),
    ("The uncontrolled motions (figs. 2 to 5, 12 to 16)", motions.section),
    ("The linear model, controllability and the gains (section IV, appendix F)", linear.section),
    ("LQR at hover (section V.A, figs. 8 and 9)", lqr_hover.section),
    ("To a set-point (section V.B, fig. 10)", position.section),
    ("Round a circle (section V.C, fig. 11)", circling.section),
    ("The computer in the loop", sampling.section),
    ("The research question: what elasticity does", elasticity.section),
    ("Rigid design, elastic cable", rigid.section),
    ("Beyond the paper", beyond.section),
)


FLIGHTS = (position.requests, circling.requests, elasticity.requests, beyond.requests, beyond_starts.requests)
"""What flies besides the hover, in the order in which it is needed."""


@dataclass(frozen=True)
class Outcome:
    """How a run came out."""

    outside: list[str]
    """Keys of the checks that are out of tolerance."""
    files: tuple[Path, Path]


def run(out: Path, quick: bool, stop: StopRequest) -> Outcome:
    """Run everything, write the page and the numbers into `out`.

    Raises flights.FlightError when a flight does not come to its end, or when asked to stop.
    """
    begun = time.monotonic()

    def say(text: str) -> None:
        if stop:
            raise FlightError(f"stopped by {stop.reason}")
        print(f"paper: {time.monotonic() - begun:5.1f} s  {text}", file=sys.stderr, flush=True)

    out.mkdir(parents=True, exist_ok=True)
    ledger = Ledger()
    with tempfile.TemporaryDirectory(prefix="sitl-paper-") as folder:
        pilot = Pilot(Path(folder), stop)
        try:
            for requests in (*lqr_hover.requests(quick), *(r(quick) for r in FLIGHTS)):
                pilot.ask(requests)
            context = Context(ledger, pilot, quick, say)
            sections = [(title, content(context)) for title, content in SECTIONS]
        finally:
            pilot.close()
        ledger.note("run", {"quick": quick, "flights": pilot.flown, "duration_s": time.monotonic() - begun})
    sections.insert(0, ("Verdicts", page.verdict_table(ledger)))
    sections.append(("Every number", _checks(ledger)))
    text = page.document(
        "Load transportation with an elastic cable, reproduced and corrected", _lead(ledger), sections
    )
    files = out / PAGE_NAME, out / NUMBERS_NAME
    files[0].write_text(text, encoding="utf-8")
    files[1].write_text(json.dumps(ledger.document(), indent=1, allow_nan=False) + "\n", encoding="utf-8")
    say(f"wrote {files[0]} and {files[1]}")
    return Outcome(ledger.outside, files)


def main(out: Path, quick: bool) -> int:
    """Run for a person; returns the exit code."""
    stop = StopRequest()
    stop.install()
    try:
        outcome = run(out, quick, stop)
    except FlightError as error:
        print(f"paper: {error}", file=sys.stderr)
        return 130 if stop else 1
    for key in outcome.outside:
        print(f"paper: out of tolerance: {key}", file=sys.stderr)
    return 1 if outcome.outside else 0


def _checks(ledger: Ledger) -> str:
    return page.text(
        "“errata.md” is the list of corrections to the paper that this project began with; other "
        "expectations come "
        "from theory, from the paper's text, from the second simulation, or from another way to compute the "
        "same. Where there is none, a number is “not judged”, and the column says why."
    ) + page.check_table(ledger)


def _lead(ledger: Ledger) -> str:
    counts: dict[str, int] = {}
    for v in ledger.verdicts:
        counts[v.verdict] = counts.get(v.verdict, 0) + 1
    tally = ", ".join(f"{count} {page.verdict(words)}" for words, count in counts.items())
    run = ledger.numbers["run"]
    return page.text(
        "A bachelor's assignment of July 2023, “Load transportation with an elastic cable: modeling and "
        "control”, derives the equations of a quadrotor that carries a load on an elastic cable, and flies "
        "it with an "
        "LQR. This page runs every experiment of that paper again and says of each claim whether it "
        f"holds: {tally}. Of {len(ledger.checks)} recorded results "
        f"{ledger.judged} have an expectation, and {ledger.judged - len(ledger.outside)} of these are within "
        "tolerance. "
        f"Flights ({run['flights']}) are real ones: the simulated vehicle and its controller run as two "
        "processes that meet only over MAVLink, 250 times a second of simulated time. Every number here was "
        f"computed in this {'quick ' if run['quick'] else ''}run of {run['duration_s']:.0f} s and stands in "
        "<code>paper.json</code> under the key given at the end."
    ) + page.text(
        "<b>Colours</b>, everywhere: vehicle blue, load orange, cable green, the load's reference black "
        "and dotted; "
        "roll, pitch and yaw, and the moments about these axes, purple, brown and pink. SI units; x east, "
        "y north, z up."
    )
