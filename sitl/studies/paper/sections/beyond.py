"""Beyond the paper: what its discussion and conclusion leave open, flown; every law side by side."""

from __future__ import annotations

from typing import Any

import numpy as np

from controller.design.stiffness import MARGIN
from sitl.report.metrics import flight_metrics
from sitl.studies.paper import page
from sitl.studies.paper.analysis import every_law
from sitl.studies.paper.analysis.beyond import (
    CIRCLE,
    CIRCLE_TO_REACH,
    EFFORT,
    LAWS,
    NO_FIGURE,
    NOISE_FROM,
    NOISE_TO_REACH,
    ON_CIRCLE,
    PLANTS,
    SOURCE,
    STEP,
    TO_REACH,
    cable_request,
    cables,
    circle_request,
    flown_laws,
    lengths,
    noise_request,
    noisy_lengths,
    plants,
    requests,
    step_request,
)
from sitl.studies.paper.analysis.noise_bound import nearest
from sitl.studies.paper.analysis.step import LENGTHS, vehicle_with
from sitl.studies.paper.context import Context
from sitl.studies.paper.drawings.beyond import draw_steps
from sitl.studies.paper.flights import Flight
from sitl.studies.paper.page import Cell
from sitl.studies.paper.record import CORRECTED, UNSUPPORTED, Ledger
from sitl.studies.paper.sections import beyond_loop, beyond_starts

__all__ = ["requests", "section"]


def section(context: Context) -> str:
    """The section's content."""
    context.say("beyond the paper: every law, with and without mismatch, on other cables")
    ledger, quick = context.ledger, context.quick
    context.pilot.ask([*requests(quick), *beyond_starts.requests(quick)])
    return (
        page.text(
            "The paper ends with what it leaves open: gain scheduling or a nonlinear controller for "
            "trajectories, "
            "the initial oscillation, and other cables. Here <code>default</code> is a linear law with "
            "feed-forward along "
            "a feasible motion, which learns the load's mass and the cable in flight; <code>geometric</code> "
            "is nonlinear, on "
            "R³ × S² × R × SO(3), follows the same motion and learns the same. The paper's two laws get "
            "the reference as it is."
        )
        + _steps(context)
        + beyond_loop.table(ledger, LAWS)
        + _circles(context)
        + beyond_starts.section(context)
        + _noise(context)
        + _cables(context)
    )


def _steps(context: Context) -> str:
    ledger, quick = context.ledger, context.quick
    shown: list[tuple[str, str, Flight]] = []
    rows: list[tuple[str | Cell, ...]] = []
    for plant in plants(quick):
        for length in lengths(plant, quick):
            for law in flown_laws(plant, quick):
                [flight] = context.pilot.fly([step_request(law, length, plant)])
                name = f"beyond.steps.{plant}.{length}.{law}"
                _judge_step(ledger, name, flight, law, TO_REACH[plant][length])
                keys = (*_STEP_KEYS, "effort_rad_s")
                words = f"{law}, l₀ = {length} m, {PLANTS[plant].words}"
                rows.append((words, *(Cell(f"{name}.{key}") for key in keys)))
                if plant == "described":
                    shown.append((law, length, flight))
    for length in lengths("heavy", quick):
        name = f"beyond.steps.heavy.{length}.default_learning_nothing"
        metrics = every_law.learning_nothing(length, PLANTS["heavy"].overrides, STEP)
        for key in _STEP_KEYS:
            ledger.put(f"{name}.{key}", metrics[key], "", "simulated in one process, for comparison")
        words = f"default that learns nothing (in one process), l₀ = {length} m, {PLANTS['heavy'].words}"
        rows.append((words, *(Cell(f"{name}.{key}") for key in _STEP_KEYS), ""))
    one, ten = (ledger.value(f"beyond.steps.described.{length}.default") for length in LENGTHS)
    paper = [ledger.value(f"beyond.steps.described.{length}.paper") for length in LENGTHS]
    ledger.judge(
        "beyond.nonlinear",
        "VI",
        "faster convergence takes a nonlinear controller or gain scheduling",
        f"2 % after {one['settling_time_2pct_s']:.1f} and {ten['settling_time_2pct_s']:.1f} s (l₀ = 1, 10 m) "
        f"instead of {paper[0]['settling_time_2pct_s']:.1f} and {paper[1]['settling_time_2pct_s']:.1f} s, "
        "by a linear law; the nonlinear one is as fast",
        UNSUPPORTED,
        "what is missing is a reference that the load can follow, not another law",
        [f"beyond.steps.described.{length}.{law}" for length in LENGTHS for law in LAWS[2:]],
    )
    return (
        page.heading("V.B, every law")
        + page.figure(
            draw_steps(shown),
            "<b>V.B by every law.</b> Distance of the load from the set-point; the dotted line is 1 cm.",
            [flight.command for _, _, flight in shown],
        )
        + page.table(
            ledger,
            ("law", "2 % [s]", "1 cm [s]", "overshoot, worst axis [%]", "rotors, rms [rad/s]"),
            rows,
        )
        + page.text(
            f"The rotors' effort: rms deviation of their speeds from those of hover, the first {EFFORT:g} s."
        )
    )


_STEP_KEYS = ("settling_time_2pct_s", "settling_time_1cm_s", "overshoot_pct")


def _judge_step(
    ledger: Ledger, name: str, flight: Flight, law: str, to_reach: tuple[float, float | None, float]
) -> None:
    metrics: dict[str, Any] = {**flight_metrics(flight.time, flight.load, flight.reference)}
    for key, bound, unit in zip(_STEP_KEYS, to_reach, ("s", "s", "%"), strict=True):
        if law in LAWS[2:] and bound is not None:
            ledger.at_most(f"{name}.{key}", metrics[key], bound, unit, SOURCE)
        else:
            ledger.put(f"{name}.{key}", metrics[key], unit, NO_FIGURE)
    effort = every_law.effort(flight.time, flight.rotors, EFFORT)
    ledger.put(f"{name}.effort_rad_s", effort, "rad/s", NO_FIGURE)


def _circles(context: Context) -> str:
    ledger, quick = context.ledger, context.quick
    rows: list[tuple[str | Cell, ...]] = []
    for plant in plants(quick):
        for length in lengths(plant, quick):
            for law in LAWS[2:]:
                [flight] = context.pilot.fly([circle_request(law, length, plant)])
                errors = np.linalg.norm(flight.load - flight.reference, axis=1)[flight.time >= ON_CIRCLE]
                name = f"beyond.circle.{plant}.{length}.{law}"
                rms = float(np.sqrt(np.mean(errors**2)))
                ledger.at_most(f"{name}.rms_m", rms, CIRCLE_TO_REACH[plant], "m", SOURCE)
                effort = every_law.effort(flight.time, flight.rotors, CIRCLE)
                ledger.put(f"{name}.effort_rad_s", effort, "rad/s", NO_FIGURE)
                words = f"{law}, l₀ = {length} m, {PLANTS[plant].words}"
                rows.append((words, Cell(f"{name}.rms_m", 1e3), Cell(f"{name}.effort_rad_s")))
    for length in LENGTHS:
        rows.append((f"paper, l₀ = {length} m", Cell(f"figures.11.{length}.tracking_rms_m", 1e3), ""))
    worst = max(ledger.value(f"beyond.circle.described.{length}.default.rms_m") for length in LENGTHS)
    wrong = max(
        ledger.value(f"beyond.circle.heavy.{length}.default.rms_m") for length in lengths("heavy", quick)
    )
    ledger.judge(
        "beyond.tracking",
        "VII",
        "trajectory tracking is for a gain-scheduling LQR or a nonlinear controller",
        f"the circle to {1e3 * worst:.2g} mm rms in time, {1e3 * wrong:.2g} mm with a load, stiffness and "
        "damping that the law is not told of; by one set of gains",
        UNSUPPORTED,
        "gains that act along the cable, feed-forward of the flat motion, and what is wrong of it learnt",
        ["beyond.circle"],
    )
    return page.heading(f"V.C, the circle, from {ON_CIRCLE:g} s on") + page.table(
        ledger, ("law", "rms error in time [mm]", "rotors, rms [rad/s]"), rows
    )


def _noise(context: Context) -> str:
    ledger = context.ledger
    rows: list[tuple[str | Cell, ...]] = []
    for length in noisy_lengths(context.quick):
        for law in LAWS[2:]:
            [flight] = context.pilot.fly([noise_request(law, length)])
            errors = np.linalg.norm(flight.load - flight.reference, axis=1)[flight.time >= NOISE_FROM]
            name, rms = f"beyond.noise.{length}.{law}", float(np.sqrt(np.mean(errors**2)))
            ledger.at_most(f"{name}.rms_m", rms, NOISE_TO_REACH[length], "m", SOURCE)
            rows.append(
                (f"{law}, l₀ = {length} m: <code>{flight.command}</code>", Cell(f"{name}.rms_m", 1e3), "")
            )
    for length in LENGTHS:
        vehicle = vehicle_with(length)
        for words, key, margin in (
            ("the promised margin", "promised", beyond_loop.LEAST_MARGIN),
            ("the margin that our designs keep in hover", "kept", MARGIN),
        ):
            name, held = f"beyond.noise.{length}.theory.{key}", nearest(vehicle, margin)
            ledger.put(f"{name}.rms_m", held.rms, "m", "H2 optimum of the linear loop: what can be reached")
            ledger.put(f"{name}.margin_s", held.margin, "s", NO_FIGURE)
            rows.append(
                (
                    f"theory, l₀ = {length} m, {words}",
                    Cell(f"{name}.rms_m", 1e3),
                    Cell(f"{name}.margin_s", 1e3),
                )
            )
    return (
        page.heading("Held against 5 N of noise on the load")
        + page.table(ledger, ("law", "rms error [mm]", "least margin of one input [ms]"), rows)
        + page.text(
            "Theory: the LQ law that minimises the load's variance at a price of effort, with the least "
            "price at which each input still bears the delay. A law near to it is stiff, and a stiff law "
            "swings up a load that begins far off: it asks for more lean than there is. So our gains are "
            "stiff near the reference, and soft far from it and along fast motions."
        )
    )


def _cables(context: Context) -> str:
    ledger = context.ledger
    rows: list[tuple[str | Cell, ...]] = []
    for cable in cables(context.quick):
        [flight] = context.pilot.fly([cable_request(cable)])
        metrics: dict[str, Any] = {**flight_metrics(flight.time, flight.load, flight.reference)}
        name = f"beyond.cables.{cable}"
        ledger.at_most(f"{name}.settling_time_2pct_s", metrics["settling_time_2pct_s"], 3.6, "s", SOURCE)
        ledger.put(f"{name}.settling_time_1cm_s", metrics["settling_time_1cm_s"], "s", NO_FIGURE)
        ledger.at_most(f"{name}.overshoot_pct", metrics["overshoot_pct"], 5.0, "%", SOURCE)
        rows.append((f"{cable}: <code>{flight.command}</code>", *(Cell(f"{name}.{k}") for k in _STEP_KEYS)))
    slowest = max(ledger.value(f"beyond.cables.{c}.settling_time_2pct_s") for c in cables(context.quick))
    ledger.judge(
        "beyond.cables",
        "VII",
        "a wider range of cables is to be explored",
        "ropes of nylon and other materials, one that only pulls, and a chain with mass: V.B within "
        f"{slowest:.1f} s",
        CORRECTED,
        "the law is designed for what the cable acts as about hover; what differs is learnt as a mismatch is",
        ["beyond.cables"],
    )
    return page.heading("V.B on other cables, 10 m") + page.table(
        ledger, ("cable", "2 % [s]", "1 cm [s]", "overshoot, worst axis [%]"), rows
    )
