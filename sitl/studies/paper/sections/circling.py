"""Section V.C, fig. 11: the load on a circle, as the paper draws it, and what that drawing hides."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.design.catalogue import paper_weights
from controller.design.model import LinearModel, with_integrator
from sitl.report.metrics import STEADY_FROM
from sitl.studies.paper import independent_simulation as second
from sitl.studies.paper import page, plots, riccati
from sitl.studies.paper.analysis.linear_model import gains, hover_point
from sitl.studies.paper.analysis.starts import largest_difference
from sitl.studies.paper.analysis.step import LENGTHS, around, law
from sitl.studies.paper.context import Context
from sitl.studies.paper.flights import Flight, Request
from sitl.studies.paper.page import Cell
from sitl.studies.paper.record import UNSUPPORTED, Ledger
from sitl_bridge.vehicle.description import Vehicle

Array = NDArray[np.float64]

PERIOD = 2.0 * math.pi
"""s"""
AGREEMENT = 0.05
"""Flown at 250 Hz against the paper's continuous gains in the second simulation, m."""
LAGS = {"1": 75.0, "10": 109.0}
"""Degrees, for l₀ = 1 and 10 m; docs/paper.md"""


COLUMNS = (
    "phase_lag_deg",
    "theory_phase_lag_deg",
    "radius_ratio",
    "radius_ratio_linear",
    "tracking_rms_m",
    "largest_distance_from_a_circle_m",
    "largest_difference_m",
)
"""Of the page's table, in this order."""


def turns(quick: bool) -> int:
    """How many turns, after everything has settled, are judged."""
    return 2 if quick else 5


def requests(quick: bool) -> list[Request]:
    """The paper's design on each cable, and our default design on the long one."""
    duration = math.ceil(STEADY_FROM + turns(quick) * PERIOD)
    paper = [Request("circle", "paper", duration, (f"cable.rest_length={length}",)) for length in LENGTHS]
    return [*paper, Request("circle", "default", duration, ("cable.rest_length=10",))]


def section(context: Context) -> str:
    """The section's content."""
    ledger = context.ledger
    periods = turns(context.quick)
    context.say("figure 11: the circle on 10 m and on 1 m of cable")
    flights = context.pilot.fly(requests(context.quick))
    others: list[second.Run] = []
    rows: list[tuple[str | Cell, ...]] = []
    for length, flight in zip(LENGTHS, flights, strict=False):
        vehicle, name = flight.vehicle_description, f"figures.11.{length}"
        other = second.fly(vehicle, law(vehicle, around), flight.time)
        others.append(other)
        lag, ratio, rms = lag_and_ratio(flight, periods)
        theory = frequency_response(vehicle)
        theory_lag, theory_ratio = -math.degrees(np.angle(theory)), abs(theory)
        ledger.check(f"{name}.phase_lag_deg", lag, LAGS[length], 1.0, "°", "errata.md")
        ledger.check(
            f"{name}.phase_lag_minus_theory_deg", lag - theory_lag, 0.0, 2.0, "°", "linear frequency response"
        )
        _, second_ratio, _ = lag_and_ratio(flight._replace(load=other.load), periods)
        ledger.check(f"{name}.radius_ratio", ratio, second_ratio, 0.005, "", "second simulation")
        again = frequency_response_again(vehicle)
        source = "second simulation's linmod, gain without a Riccati solver"
        again_lag = -math.degrees(np.angle(again))
        ledger.check(f"{name}.theory_phase_lag_deg", theory_lag, again_lag, 0.01, "°", source)
        ledger.check(f"{name}.radius_ratio_linear", theory_ratio, abs(again), 1e-4, "", source)
        ledger.at_least(f"{name}.tracking_rms_m", rms, 1.0, "m", "errata.md: metres from the reference")
        ledger.at_most(
            f"{name}.largest_difference_m",
            largest_difference(flight, other),
            AGREEMENT,
            "m",
            "second simulation",
        )
        shape = circle_shape_error(flight)
        ledger.at_most(f"{name}.largest_distance_from_a_circle_m", shape, 0.15, "m", "V.C: traces a circle")
        rows.append((f"paper's design, l₀ = {length} m", *(Cell(f"{name}.{key}") for key in COLUMNS)))
    rows.append(_default_design(ledger, flights[2], periods))
    one, ten = (ledger.numbers["figures"]["11"][length] for length in LENGTHS)
    ledger.judge(
        "figures.11",
        "V.C, fig. 11",
        "“it is able to follow the circle quite well after it has stabilized”",
        f"in shape: {100 * one['radius_ratio']:.0f} % and {100 * ten['radius_ratio']:.0f} % of the radius "
        "(l₀ = 1, 10 m). "
        f"In time the load runs {one['phase_lag_deg']:.0f}° and {ten['phase_lag_deg']:.0f}° behind, "
        f"{one['tracking_rms_m']:.1f} and {ten['tracking_rms_m']:.1f} m from where it should be",
        UNSUPPORTED,
        "the figure shows no time; a reference through the integrator alone has to lag",
        ["figures.11.1", "figures.11.10"],
    )
    return (
        page.figure(
            _draw_circle(flights[1]),
            "<b>Fig. 11, as the paper draws it</b> (l₀ = 10 m): crosses are the vehicle, circles the load, "
            "at the same "
            f"times, joined by the cable; the last {PERIOD:.1f} s of the flight. A grey line joins load "
            "and reference "
            "at one and the same time: what the figure hides.",
            [flights[1].command],
        )
        + page.figure(
            _draw_in_time(flights, others),
            "<b>The same flights in time.</b> Broad: flown over the link; dashed: the paper's continuous "
            "gains in the "
            "second simulation. Below: the load's distance from its reference.",
            [flight.command for flight in flights],
        )
        + page.table(
            ledger,
            (
                "",
                "phase lag [°]",
                "in theory [°]",
                "radius ratio",
                "in theory",
                "rms error [m]",
                "largest distance from a circle [m]",
                "between the two [m]",
            ),
            rows,
        )
    )


def _default_design(ledger: Ledger, flight: Flight, periods: int) -> tuple[str | Cell, ...]:
    """A row for our default design, whose feed-forward should leave neither lag nor error."""
    name, source = "figures.11.default_design_on_10", "a feasible motion, fed forward"
    lag, ratio, rms = lag_and_ratio(flight, periods)
    ledger.check(f"{name}.phase_lag_deg", lag, 0.0, 0.5, "°", source)
    ledger.check(f"{name}.radius_ratio", ratio, 1.0, 0.005, "", source)
    ledger.at_most(f"{name}.tracking_rms_m", rms, 0.05, "m", source)
    shape = circle_shape_error(flight)
    ledger.at_most(f"{name}.largest_distance_from_a_circle_m", shape, 0.05, "m", source)
    known = ledger.value(name)
    return ("our default design, l₀ = 10 m", *(Cell(f"{name}.{k}") if k in known else "" for k in COLUMNS))


def last_periods(flight: Flight, periods: int) -> slice:
    """The rows of a flight's last whole turns."""
    return slice(len(flight.time) - 1 - round(periods * PERIOD / (flight.time[1] - flight.time[0])), -1)


def lag_and_ratio(flight: Flight, periods: int) -> tuple[float, float, float]:
    """Phase lag (degrees), radius over the reference's, both of the first harmonic, and rms error (m)."""
    rows = last_periods(flight, periods)
    turn = np.exp(-2j * math.pi * flight.time[rows] / PERIOD)
    # East and north together: the complex amplitude of a rotation at the reference's own rate.
    load, reference = ((p[rows, 1] + 1j * p[rows, 0]) @ turn for p in (flight.load, flight.reference))
    error = flight.load[rows] - flight.reference[rows]
    share = load / reference
    return (
        float(-np.degrees(np.angle(share))),
        float(abs(share)),
        float(np.sqrt(np.mean(np.sum(error**2, axis=1)))),
    )


def circle_shape_error(flight: Flight) -> float:
    """Largest distance of the load from its own mean circle in the last turn, m."""
    rows = last_periods(flight, 1)
    radius = np.hypot(flight.load[rows, 0], flight.load[rows, 1])
    height = flight.load[rows, 2]
    return float(np.hypot(radius - radius.mean(), height - height.mean()).max())


def frequency_response(vehicle: Vehicle) -> complex:
    """From p_ref to p_p along x at 1 rad/s, the paper's continuous integral LQR."""
    gain, model = gains(vehicle, integral=True)
    return _response(model, gain)


def frequency_response_again(vehicle: Vehicle) -> complex:
    """The same from the second simulation's Jacobian, and a gain without a Riccati solver."""
    wrench = (vehicle.hover_thrust, 0.0, 0.0, 0.0)
    model = with_integrator(LinearModel(*second.jacobians(vehicle, hover_point(vehicle), wrench)))
    return _response(model, riccati.continuous(model, paper_weights()).gain)


def _response(model: LinearModel, gain: Array) -> complex:
    size = len(model.A)
    into = np.zeros(size)
    into[18] = -1.0  # v' = p_p - p_ref
    return complex(np.linalg.solve(1j * np.eye(size) - (model.A - model.B @ gain), into)[3])


def _draw_circle(flight: Flight) -> bytes:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure = plt.figure(figsize=(9.5, 5.0), layout="constrained")
    rows = last_periods(flight, 1)
    some = np.arange(rows.start, len(flight.time) - 1, round(PERIOD / 24 / (flight.time[1] - flight.time[0])))
    space: Any = figure.add_subplot(1, 2, 1, projection="3d")
    top: Any = figure.add_subplot(1, 2, 2)
    some = some[:24]
    vehicle, load, reference = flight.vehicle[some], flight.load[some], flight.reference[some]
    for v, p in zip(vehicle, load, strict=True):
        space.plot(*np.stack([v, p]).T, color=plots.CABLE, lw=0.8)
        top.plot(*np.stack([v, p]).T[:2], color=plots.CABLE, lw=0.8)
    for ax, columns in ((space, [0, 1, 2]), (top, [0, 1])):
        ax.plot(*vehicle.T[columns], "x", color=plots.VEHICLE, label="vehicle")
        ax.plot(*load.T[columns], "o", mfc="none", color=plots.LOAD, label="load")
        ax.plot([], [], color=plots.CABLE, label="cable")
        ax.plot(
            *flight.reference[rows].T[columns], color=plots.REFERENCE, ls=":", label="reference of the load"
        )
    for r, p in zip(reference[::6], load[::6], strict=True):
        top.plot(*np.stack([r, p]).T[:2], color=plots.NEUTRAL, lw=1.2)
        top.plot(*r[:2], "s", color=plots.REFERENCE, ms=5)
    top.plot(
        [], [], color=plots.NEUTRAL, marker="s", mfc=plots.REFERENCE, label="load to reference, same time"
    )
    top.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="from above")
    top.grid(alpha=0.3)
    space.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    handles, labels = top.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize="small")
    return plots.png(figure)


def _draw_in_time(flights: list[Flight], others: list[second.Run]) -> bytes:
    figure, axes = plots.panels(3, 1, height=2.2, sharex=True)
    for row, index in enumerate((LENGTHS.index("10"), LENGTHS.index("1"))):
        flight, other, ax = flights[index], others[index], axes[row, 0]
        plots.pair(ax, plots.LOAD, "load x", (flight.time, flight.load[:, 0]), (other.time, other.load[:, 0]))
        plots.reference(ax, flight.time, flight.reference[:, 0])
        ax.set_ylabel(f"x [m], l₀ = {LENGTHS[index]} m")
    ax = axes[2, 0]
    styles = {
        "paper's design, l₀ = 1 m": "-",
        "paper's design, l₀ = 10 m": "--",
        "default design, l₀ = 10 m": "-.",
    }
    for (label, style), flight in zip(styles.items(), flights, strict=True):
        error = np.linalg.norm(flight.load - flight.reference, axis=1)
        ax.plot(flight.time, error, color=plots.LOAD, ls=style, label=label)
    ax.set(xlabel="time [s]", ylabel="distance from reference [m]")
    ax.legend(fontsize="small", loc="center right")
    plots.shared_legend(figure, axes[0, 0])
    return plots.png(figure)
