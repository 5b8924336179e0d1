"""The initial oscillation, beyond the paper: a motion planned from the state at the start."""

from __future__ import annotations

import math

import numpy as np

from controller.design.catalogue import design
from controller.law.reference import setpoint
from sitl.studies.paper import offline, page
from sitl.studies.paper.analysis.beyond import LAWS, NO_FIGURE, SOURCE
from sitl.studies.paper.analysis.quiet import (
    LEAST_DAMPING,
    PAPERS_SHARE,
    STARTS,
    WATCHED,
    bounce_damping,
    overrides,
    quiet_after,
    request,
)
from sitl.studies.paper.analysis.step import LENGTHS, vehicle_with
from sitl.studies.paper.context import Context
from sitl.studies.paper.drawings.beyond import Shown, draw_starts
from sitl.studies.paper.flights import Request
from sitl.studies.paper.page import Cell
from sitl.studies.paper.record import UNSUPPORTED
from sitl_bridge.vehicle.files import load_vehicle


def lengths(quick: bool) -> tuple[str, ...]:
    """The cables that fly."""
    return LENGTHS[1:] if quick else LENGTHS


def requests(quick: bool) -> list[Request]:
    """What flies; the paper's law, which turns over, does so in one process."""
    return [request(law, length, start) for start in STARTS for length in lengths(quick) for law in LAWS[2:]]


def section(context: Context) -> str:
    """When load and cable are quiet after each start, and the damping of the bounce."""
    ledger = context.ledger
    rows: list[tuple[str | Cell, ...]] = []
    shown: list[Shown] = []
    for start, words in STARTS.items():
        for length in lengths(context.quick):
            papers = _paper(length, start)
            shown.append(papers)
            name = f"beyond.start.{start}.{length}"
            after = quiet_after(papers.time, papers.vehicle, papers.load, papers.reference)
            ledger.put(f"{name}.paper.quiet_after_s", after, "s", "simulated in one process")
            rows.append(
                (f"paper (in one process), l₀ = {length} m, {words}", Cell(f"{name}.paper.quiet_after_s"))
            )
            for law in LAWS[2:]:
                [flight] = context.pilot.fly([request(law, length, start)])
                shown.append(
                    Shown(law, length, start, flight.time, flight.vehicle, flight.load, flight.reference)
                )
                ours, key = quiet_after(*shown[-1][3:]), f"{name}.{law}.quiet_after_s"
                if math.isfinite(after):
                    ledger.at_most(key, ours, PAPERS_SHARE * after, "s", "half of the paper's law")
                else:
                    ledger.at_most(key, ours, WATCHED, "s", "the paper's law turns over")
                rows.append((f"{law}, l₀ = {length} m, {words}: <code>{flight.command}</code>", Cell(key)))
    damped = _damping(context)
    slowest = max(
        ledger.value(f"beyond.start.{start}.{length}.default.quiet_after_s")
        for start in STARTS
        for length in lengths(context.quick)
    )
    ledger.judge(
        "beyond.start",
        "VI",
        "the initial oscillation remains",
        f"load and cable are quiet after {slowest:.1f} s at most, from rest length and from a swing of 20°",
        UNSUPPORTED,
        "the reference is planned from the state at the start, so that the feedback has nothing to catch",
        ["beyond.start"],
    )
    return (
        page.heading("The initial oscillation")
        + page.figure(
            draw_starts(shown),
            "<b>From a start that is not at rest.</b> Distance of the load from its place; dotted: 1 cm.",
            [],
        )
        + page.table(ledger, ("law and start", "quiet: load within 1 cm, cable within 1°, after [s]"), rows)
        + page.text(
            "The motion begins with the derivatives that the load has at the start, and ends at rest at "
            "its place, in the shortest time in which tilt, thrust and tension stay within their limits."
        )
        + damped
    )


def _paper(length: str, start: str) -> Shown:
    vehicle = load_vehicle("paper", [*overrides(start, length)])
    at = vehicle.initial_load_position
    motion = offline.closed_loop(
        vehicle, design("paper", vehicle, offline.RATE_HZ), setpoint(at, at), WATCHED
    )
    place = np.tile(at, (len(motion.time), 1))
    return Shown("paper", length, start, motion.time, motion.vehicle, motion.load, place)


def _damping(context: Context) -> str:
    ledger = context.ledger
    rows: list[tuple[str | Cell, ...]] = []
    for length in LENGTHS:
        vehicle = vehicle_with(length)
        for law in LAWS:
            key = f"beyond.bounce.{length}.{law}.damping_ratio"
            damping = bounce_damping(vehicle, design(law, vehicle, offline.RATE_HZ))
            if law in LAWS[2:]:
                ledger.at_least(key, damping, LEAST_DAMPING, "", SOURCE)
            else:
                ledger.put(key, damping, "", NO_FIGURE)
            rows.append((f"{law}, l₀ = {length} m", Cell(key)))
    return page.text("The bounce that is left to the feedback is damped like this:") + page.table(
        ledger, ("law", "damping ratio of the bounce at hover"), rows
    )
