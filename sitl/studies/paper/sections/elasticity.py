"""The research question: how does the elasticity in the cable affect the system behaviour?"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from controller.design.catalogue import paper_weights
from controller.design.lqr import sampled_gain, sampled_model
from controller.design.model import linear_model, with_integrator
from sitl.report.metrics import settling_time
from sitl.studies.paper import independent_simulation as second
from sitl.studies.paper import page, riccati
from sitl.studies.paper.analysis.crossed_gains import crossed_growths, crossed_growths_again, hover_wrench
from sitl.studies.paper.analysis.linear_model import damping_ratio, gains, hover_point
from sitl.studies.paper.analysis.step import TARGET
from sitl.studies.paper.analysis.stiffness import (
    DURATION,
    FAST_HZ,
    LINMOD_TOLERANCE,
    RATE_HZ,
    ROW,
    ROW_HEAD,
    Response,
    fly_again,
    nearest,
    on,
    settling_by_continuous_law,
    settling_by_fast_sampling,
    swept,
)
from sitl.studies.paper.context import Context
from sitl.studies.paper.drawings.elasticity import draw_crossed, draw_stiffness
from sitl.studies.paper.flights import Request
from sitl.studies.paper.page import Cell
from sitl.studies.paper.record import CORRECTED, UNSUPPORTED, Ledger
from sitl_bridge.vehicle.description import Vehicle

Array = NDArray[np.float64]

STIFFNESSES = (20.0, 50.0, 100.0, 200.0, 500.0, 1e3, 3e3, 1e4, 3e4, 1e5)
FEW_STIFFNESSES = (20.0, 100.0, 1e3, 1e4, 1e5)
FLOWN = (20.0, 100.0, 1e4)
"""Stiffnesses that fly over the link too, N/m."""
OTHERS: dict[str, tuple[str, tuple[float, ...]]] = {
    "cable.damping": ("c_a [N s/m]", (0.0, 3.0, 10.0, 30.0, 100.0)),
    "cable.rest_length": ("l₀ [m]", (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)),
    "load.mass": ("m_p [kg]", (1.0, 3.0, 10.0, 15.0)),
}
CHOSEN = "chosen: a value of the sweep, not a result"


def record(ledger: Ledger, key: str, vehicle: Vehicle, found: Response) -> None:
    """Put a response under `key`, each figure beside the same of a second computation.

    Open-loop modes: eigenvalues of the second simulation's Jacobian. The closed loop's: the symplectic
    pencil. Settling, overshoot and tension: the same law, sampled, in the second simulation.
    """
    poles = np.linalg.eigvals(second.jacobians(vehicle, hover_point(vehicle), hover_wrench(vehicle))[0])
    bounce, pendulum = nearest(poles, found.bounce), nearest(poles, 1j * found.pendulum)
    model = with_integrator(linear_model(vehicle))
    optimum = riccati.sampled(sampled_model(model, paper_weights(), 1.0 / RATE_HZ))
    closed = nearest(np.log(optimum.poles) * RATE_HZ, found.bounce_closed)
    other = fly_again(vehicle, optimum.gain)
    linmod, pencil, again = (
        "second simulation's linmod",
        "symplectic pencil",
        "the same law in the second simulation",
    )
    weight = vehicle.load.mass * vehicle.gravity
    ledger.check(f"{key}.stretch_m", found.stretch, weight / vehicle.cable.stiffness, 1e-9, "m", "m_p g/k_a")
    for name, pole, expected, source in (
        ("bounce_pole_1_s", found.bounce, bounce, linmod),
        ("bounce_pole_closed_loop_1_s", found.bounce_closed, closed, pencil),
    ):
        ledger.check_array(f"{key}.{name}", pole, expected, LINMOD_TOLERANCE * abs(pole), "1/s", source)
    for name, pole, expected in (
        ("bounce", found.bounce, bounce),
        ("pendulum", 1j * found.pendulum, pendulum),
    ):
        frequency = abs(pole) / (2.0 * math.pi)
        within = LINMOD_TOLERANCE * frequency
        ledger.check(
            f"{key}.{name}_frequency_hz", frequency, abs(expected) / (2.0 * math.pi), within, "Hz", linmod
        )
    for name, pole, expected, source in (
        ("bounce_damping_ratio", found.bounce, bounce, linmod),
        ("bounce_damping_ratio_closed_loop", found.bounce_closed, closed, pencil),
    ):
        ratio = damping_ratio(pole)
        ledger.check(f"{key}.{name}", ratio, damping_ratio(expected), LINMOD_TOLERANCE, "", source)
    ledger.same(f"{key}.diverged", found.diverged, other.diverged, again)
    name = f"{key}.settling_time_2pct_s"
    if found.settling is None or other.settling is None:
        ledger.same(name, found.settling, other.settling, again)
    else:
        ledger.check(name, found.settling, other.settling, 0.008, "s", again)
    ledger.check(f"{key}.overshoot_pct", found.overshoot, other.overshoot, 0.01, "%", again)
    ledger.check(f"{key}.peak_tension_N", found.peak_tension, other.peak_tension, 0.01, "N", again)


def requests(quick: bool) -> list[Request]:
    """The points of the sweep over the stiffness that fly over the link too."""
    return [Request("setpoint", "paper", DURATION, (f"cable.stiffness={k!r}",)) for k in FLOWN]


def section(context: Context) -> str:
    """The section's content."""
    return _stiffness(context) + _others(context) + _crossed(context)


def _stiffness(context: Context) -> str:
    ledger = context.ledger
    context.say("elasticity: stiffness")
    stiffnesses = FEW_STIFFNESSES if context.quick else STIFFNESSES
    responses = swept("cable.stiffness", stiffnesses)
    ledger.rows("elasticity", len(responses))
    for i, (k, r) in enumerate(responses.items()):
        ledger.put(f"elasticity.{i}.stiffness_N_m", k, "N/m", CHOSEN)
        record(ledger, f"elasticity.{i}", on(f"cable.stiffness={k!r}"), r)
    context.say("elasticity: three stiffnesses over the link")
    flown_rows: list[tuple[float, float, float]] = []
    flown_cells: list[tuple[str | Cell, ...]] = []
    for k, flight in zip(FLOWN, context.pilot.fly(requests(context.quick)), strict=True):
        error = np.linalg.norm(flight.load - np.array(TARGET), axis=1)
        settled = settling_time(flight.time, error, 0.02 * float(error[0])) or math.inf
        key, r = f"elasticity_flown.{k:.0f}_N_m", responses[k]
        ledger.check(
            f"{key}.settling_time_2pct_s", settled, r.settling or math.nan, 0.008, "s", "the sweep, offline"
        )
        peak = float(flight.tension.max())
        ledger.check(f"{key}.peak_tension_N", peak, r.peak_tension, 0.05, "N", "the sweep, offline")
        flown_rows.append((k, settled, peak))
        row = f"elasticity.{stiffnesses.index(k)}"
        keys = ("settling_time_2pct_s", "peak_tension_N")
        flown_cells.append((f"{k:g}", *(Cell(f"{place}.{name}") for name in keys for place in (key, row))))
    table, stiffest = responses, responses[1e5]
    compared = (100.0, 1e5) if context.quick else stiffnesses
    continuous = {k: settling_by_continuous_law(on(f"cable.stiffness={k!r}")) for k in compared}
    settling = "elasticity_findings.settling_continuous_gains_s"
    for k, seconds in continuous.items():
        again = settling_by_fast_sampling(on(f"cable.stiffness={k!r}"))
        ledger.check(
            f"{settling}.{k:.0f}_N_m", seconds, again, 0.05, "s", f"the plant, held at {FAST_HZ:g} Hz"
        )
    change = continuous[1e5] - continuous[100.0]
    ledger.at_most("elasticity_findings.settling_1e5_minus_100_N_m_s", change, 0.1, "s", "errata.md: as fast")
    moved = max(abs(r.bounce_closed - r.bounce) / abs(r.bounce) for k, r in table.items() if k >= 100.0)
    ledger.at_most(
        "elasticity_findings.bounce_pole_moved_by_at_most", moved, 0.05, "", "the weights leave it"
    )
    heights = {}
    for name, vehicle in (("100_N_m", on()), ("1e5_N_m", on("cable.stiffness=1e5"))):
        continuous_gain, model = gains(vehicle, integral=True)
        cost = sampled_model(model, paper_weights(), 1.0 / RATE_HZ)
        found = {
            "continuous_N_m": (continuous_gain, riccati.continuous(model, paper_weights()).gain),
            "at_250_hz_N_m": (sampled_gain(cost).state, riccati.sampled(cost).gain),
        }
        for kind, (made, twice) in found.items():
            key = f"elasticity_findings.thrust_gain_on_heights_of_vehicle_and_load.{name}.{kind}"
            both = "eigenvectors of the Hamiltonian"
            ledger.check_array(key, made[0, [2, 5]], twice[0, [2, 5]], 1e-5, "N/m", both)
        heights[name] = {kind: made[0, [2, 5]].tolist() for kind, (made, _) in found.items()}
    ledger.judge(
        "elasticity.faster",
        "VII",
        "“utilize the elasticity for getting to the desired position quickly”",
        f"with the paper's continuous gains 2 % after {continuous[100.0]:.2f} s at 100 N/m and after "
        f"{continuous[1e5]:.2f} s at 1e5 N/m",
        UNSUPPORTED,
        "a stiff cable is as fast",
        ["elasticity_findings.settling_1e5_minus_100_N_m_s"],
    )
    ledger.judge(
        "elasticity.question",
        "I, VII",
        "elasticity affects the behaviour (no figure says how)",
        "it adds one mode, the bounce, that these weights leave as it is, and a stretch of m_p g/k_a; from "
        "about "
        "1000 N/m on the response is that of a stiff cable",
        CORRECTED,
        "shown here over k_a, c_a, l₀ and m_p",
        ["elasticity_findings", "elasticity_flown"],
    )
    rows: list[tuple[str | Cell, ...]] = []
    for i, k in enumerate(table):
        cells: list[str | Cell] = [Cell(f"elasticity.{i}.{key}") for key in ROW]
        beside = Cell(f"{settling}.{k:.0f}_N_m") if k in continuous else ""
        rows.append((f"{k:g}", *cells[:6], beside, *cells[6:]))
    return (
        page.text(
            "The experiment is V.B (l₀ = 10 m, Table I otherwise), the paper's weights, gains designed "
            "anew for each "
            f"cable and for {RATE_HZ:g} Hz. Simulated offline with the plant's own equations, rotor limits "
            "included; "
            "beside it the paper's continuous gains in the second simulation."
        )
        + page.heading("Stiffness")
        + page.figure(
            draw_stiffness(table, flown_rows),
            "<b>Over the stiffness k_a.</b> Dots: the sweep; rings: flown over the link.",
            [request.command for request in requests(context.quick)],
        )
        + page.table(ledger, ("k_a [N/m]", *ROW_HEAD[:6], "with continuous gains [s]", *ROW_HEAD[6:]), rows)
        + page.text(
            f"At 1e5 N/m and {RATE_HZ:g} Hz settling takes {page.number(stiffest.settling)} s, not for the "
            "cable's sake: in "
            "the linear model of so stiff a cable vehicle and load have the same height, and the sampled "
            "design "
            "splits its gain between the two differently "
            f"({heights['1e5_N_m']['at_250_hz_N_m'][0]:.0f} and "
            f"{heights['1e5_N_m']['at_250_hz_N_m'][1]:.0f} N/m, continuous "
            f"{heights['1e5_N_m']['continuous_N_m'][0]:.0f} and "
            f"{heights['1e5_N_m']['continuous_N_m'][1]:.0f} N/m); "
            "but when the load swings out, the heights do differ. With the continuous gains the stiff "
            "cable settles "
            f"after {continuous[1e5]:.2f} s."
        )
        + page.text("Flown over the link, beside the sweep:")
        + page.table(
            ledger,
            ("k_a [N/m]", "2 % settling, flown [s]", "offline [s]", "peak tension, flown [N]", "offline [N]"),
            flown_cells,
        )
    )


def _others(context: Context) -> str:
    """c_a, l₀ and m_p, one at a time from Table I."""
    ledger, blocks = context.ledger, [page.heading("Damping, length and load")]
    for key, (label, values) in OTHERS.items():
        context.say(f"elasticity: {key}")
        some = (values[0], values[-1]) if context.quick else values
        rows: list[tuple[str | Cell, ...]] = []
        parameter = key.replace(".", "_")
        name = f"elasticity_over.{parameter}"
        ledger.rows(name, len(some))
        for i, (value, response) in enumerate(swept(key, some).items()):
            vehicle = on(f"{key}={value!r}")
            ledger.put(f"{name}.{i}.{parameter}", value, "", CHOSEN)
            record(ledger, f"{name}.{i}", vehicle, response)
            cells: list[str | Cell] = [Cell(f"{name}.{i}.{column}") for column in ROW]
            if response.diverged:
                cells[ROW.index("settling_time_2pct_s")] = "diverges"
            rows.append((f"{value:g}", *cells))
        blocks.append(page.table(ledger, (label, *ROW_HEAD), rows))
    return "".join(blocks)


def _crossed(context: Context) -> str:
    """How far a controller designed for one cable flies another."""
    ledger = context.ledger
    context.say("elasticity: controllers on cables they were not designed for")
    blocks = []
    for key, label, values in (
        ("cable.stiffness", "k_a [N/m]", (20.0, 50.0, 100.0, 300.0, 1e3, 1e4, 1e5)),
        ("cable.rest_length", "l₀ [m]", (0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0)),
    ):
        vehicles = [on(f"{key}={value!r}") for value in values]
        growths, again = crossed_growths(vehicles), crossed_growths_again(vehicles)
        name = f"elasticity_crossed.{key.replace('.', '_')}"
        ledger.put(f"{name}.values", values, label.split("[")[1].rstrip("]"), CHOSEN)
        source = "second simulation's linmod, gains from the symplectic pencil"
        ledger.check_array(f"{name}.growth_1_s", growths, again, 1e-3, "1/s", source)
        ledger.at_most(
            f"{name}.largest_growth_on_its_own_cable_1_s", float(np.diag(growths).max()), -0.1, "1/s", "own"
        )
        if key == "cable.rest_length":
            one, ten = values.index(1.0), values.index(10.0)
            ledger.at_least(
                f"{name}.growth_of_1_on_10_1_s", float(growths[one, ten]), 1e-3, "1/s", "errata.md, V.B"
            )
            ledger.at_least(
                f"{name}.growth_of_10_on_1_1_s", float(growths[ten, one]), 1e-3, "1/s", "errata.md, V.B"
            )
        stable = int(np.sum(growths < 0.0))
        ledger.check(f"{name}.stable_pairs", stable, int(np.sum(again < 0.0)), 0, "", source)
        blocks.append(
            page.figure(
                draw_crossed(growths, values, label),
                f"<b>Designed for one {label.split()[0]}, flown on another.</b> Growth rate of the sampled "
                "linear loop: "
                f"blue and negative is stable, red unstable. {stable} of {growths.size} pairs are stable.",
            )
        )
    return page.heading("Controllers on cables that they were not designed for") + "".join(blocks)
