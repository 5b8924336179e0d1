"""Section V.A, figs. 8 and 9: the LQR at hover, without and with noise; its steady-state error."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from sitl.studies.paper import independent_simulation as second
from sitl.studies.paper import page, plots
from sitl.studies.paper.context import Context
from sitl.studies.paper.flights import Flight, Request
from sitl.studies.paper.page import Cell
from sitl.studies.paper.record import CORRECTED, REPRODUCED
from sitl.studies.paper.sections.linear import gains, hover_point
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle

Array = NDArray[np.float64]

BAND = 0.25
"""What V.A keeps x, y and z within, m."""
FORCE_STD = 5.0
"""Standard deviation of the white force on the load, N (docs/paper.md: the paper does not say)."""
HOLD_TIME = 0.01
"""s"""
AGREEMENT = 1e-3
"""Flown at 250 Hz against the paper's continuous law in the second simulation, m."""


class Start(NamedTuple):
    """One of the initial conditions that the text could mean."""

    title: str
    overrides: tuple[str, ...]


STARTS = {
    "rest_length": Start("Table I, l = l₀ = 1 m at the start", ("initial.vehicle_position=[0, 0, 1]",)),
    "equilibrium": Start("at the equilibrium, l = 1.981 m", ()),
    "printed": Start(
        "at the printed x*, z_v = 2.5, z_p = 0.5 m",
        ("initial.vehicle_position=[0, 0, 2.5]", "initial.load_position=[0, 0, 0.5]"),
    ),
    "long_cable": Start(
        "l₀ = 10 m with z_v = 2.5, z_p = 0.5 m",
        (
            "cable.rest_length=10",
            "initial.vehicle_position=[0, 0, 2.5]",
            "initial.load_position=[0, 0, 0.5]",
        ),
    ),
}


NOISE = (f"disturbance.force_std={FORCE_STD:g}", "disturbance.acts_on=load")
HEAVY = ("load.mass=11",)
"""Of the plant alone: heavier than the controller knows."""


def noisy_starts(quick: bool) -> dict[str, Start]:
    """The starts that fly under noise."""
    return {key: start for key, start in STARTS.items() if key == "equilibrium" or not quick}


def requests(quick: bool) -> tuple[list[Request], list[Request], list[Request]]:
    """Flights of figure 8, of figure 9, and with the heavier load: LQR, then integral LQR."""
    calm, noisy = (15.0, 20.0) if quick else (30.0, 30.0)
    return (
        [Request("hover", "paper-lqr", calm, start.overrides) for start in STARTS.values()],
        [Request("hover", "paper-lqr", noisy, (*s.overrides, *NOISE)) for s in noisy_starts(quick).values()],
        [Request("hover", "paper-lqr", 45.0, (), HEAVY), Request("hover", "paper", 20.0, (), HEAVY)],
    )


def section(context: Context) -> str:
    """The section's content."""
    return _figure_8(context) + _figure_9(context) + _steady_state(context)


def law(vehicle: Vehicle, start: Vehicle | None = None) -> second.Law:
    """The paper's LQR holding the load where it starts; `start`: the vehicle that flies, if it is another."""
    gain, _ = gains(vehicle, integral=False)
    x_star = hover_point(vehicle)
    x_star[2] += (start or vehicle).initial.load_position[2]
    x_star[5] += (start or vehicle).initial.load_position[2]
    return second.Law(gain, x_star, np.array([vehicle.hover_thrust, 0, 0, 0]), lambda _: second.STILL)


def _figure_8(context: Context) -> str:
    ledger = context.ledger
    context.say("figure 8: LQR at hover from four initial conditions")
    flights = context.pilot.fly(requests(context.quick)[0])
    others, rows = [], list[tuple[str | Cell, ...]]()
    for (key, start), flight in zip(STARTS.items(), flights, strict=True):
        other = second.fly(flight.vehicle_description, law(flight.vehicle_description), flight.time)
        others.append(other)
        name = f"figures.8.{key}"
        length = flight.vehicle_description.hover_length
        ledger.at_most(
            f"{name}.largest_difference_m",
            largest_difference(flight, other),
            AGREEMENT,
            "m",
            "second simulation",
        )
        heights = flight.reference[:, 2]
        ours = settling_heights(flight.time, flight.vehicle, flight.load, heights, length)
        theirs = settling_heights(other.time, other.vehicle, other.load, heights, length)
        for metric, value in ours.items():
            # Differences of two heights: each may be off by so much.
            ledger.check(f"{name}.{metric}", value, theirs[metric], 2 * AGREEMENT, "m", "second simulation")
        rows.append((start.title, *(Cell(f"{name}.{key}") for key in (*ours, "largest_difference_m"))))
    eight = ledger.numbers["figures"]["8"]
    ledger.at_most(
        "figures.8.equilibrium_stays_m", eight["equilibrium"]["largest_load_deviation_m"], 1e-3, "m", "x*"
    )
    ledger.at_most(
        "figures.8.printed_within_5_s_m",
        eight["printed"]["load_deviation_after_5_s_m"],
        0.01,
        "m",
        "V.A: 5 s",
    )
    ledger.at_most(
        "figures.8.rest_length_bounce_after_5_s_m",
        eight["rest_length"]["stretch_after_5_s_m"],
        0.05,
        "m",
        "V.A: 5 s",
    )
    ledger.at_least(
        "figures.8.rest_length_height_after_5_s_m",
        eight["rest_length"]["load_deviation_after_5_s_m"],
        0.1,
        "m",
        "slow pole of the gains",
    )
    slow = -max(p[0] for p in ledger.numbers["closed_loop_poles"]["K_lqr"])
    ledger.judge(
        "figures.8",
        "V.A, fig. 8",
        "“after about 5 s it has reached its equilibrium position and is stable”",
        "true of the bounce, from every start; the height takes longer wherever it begins away from x*: "
        "from l = l₀ "
        f"the load is still {eight['rest_length']['load_deviation_after_5_s_m']:.2f} m off after 5 s",
        CORRECTED,
        f"“all initial conditions 0” gives l = 0, which is singular; x* and l = l₀ differ. The gains' slow "
        f"pole decays with {slow:.2f} 1/s",
        ["figures.8"],
    )
    return (
        page.heading("Fig. 8: hover without disturbance")
        + page.figure(
            _draw_heights(list(STARTS.values()), flights, others),
            "<b>Fig. 8.</b> Flown over the link at 250 Hz (broad), and the paper's continuous law in the "
            "second "
            "simulation (dashed), from each of the starts that the text could mean. The text sets all "
            "initial "
            "conditions to 0, which would put the load into the vehicle.",
            [flight.command for flight in flights],
        )
        + page.table(
            ledger,
            (
                "start",
                "largest deviation of the load [m]",
                "largest after 5 s [m]",
                "largest stretch after 5 s [m]",
                "at the end [m]",
                "between the two simulations [m]",
            ),
            rows,
        )
    )


def settling_heights(
    time: Array, vehicle: Array, load: Array, reference: Array, length: float
) -> dict[str, float]:
    """How the heights of load and vehicle (n, 3) m settle on the reference (n,) m; length of the cable, m."""
    deviation = np.abs(load[:, 2] - reference)
    stretch = np.abs(vehicle[:, 2] - load[:, 2] - length)
    late = time >= 5.0
    return {
        "largest_load_deviation_m": float(deviation.max()),
        "load_deviation_after_5_s_m": float(deviation[late].max()),
        "stretch_after_5_s_m": float(stretch[late].max()),
        "final_load_deviation_m": float(deviation[-1]),
    }


def largest_difference(flight: Flight, other: second.Run) -> float:
    """Largest distance between the two simulations along any axis, of vehicle and load, m."""
    n = len(other.time)
    return float(
        max(np.abs(flight.load[:n] - other.load).max(), np.abs(flight.vehicle[:n] - other.vehicle).max())
    )


def _figure_9(context: Context) -> str:
    ledger = context.ledger
    context.say(f"figure 9: the same under a white force of {FORCE_STD:g} N on the load")
    starts = noisy_starts(context.quick)
    flights = context.pilot.fly(requests(context.quick)[1])
    others, rows = [], list[tuple[str | Cell, ...]]()
    for (key, start), flight in zip(starts.items(), flights, strict=True):
        vehicle = flight.vehicle_description
        held = held_forces(flight)
        other = second.fly_with_noise(vehicle, law(vehicle), held, HOLD_TIME, steps=4)
        others.append(other)
        name = f"figures.9.{key}"
        hover = _hover_position(flight)
        deviations = largest_deviations(flight.load - flight.reference, flight.vehicle - hover)
        ledger.check_array(
            f"{name}.largest_deviation_m",
            deviations,
            largest_deviations(other.load - flight.reference[0], other.vehicle - hover[0]),
            AGREEMENT,
            "m",
            "second simulation",
        )
        # On the 20 ms that both sample.
        ours = Flight(**{**flight._asdict(), "load": flight.load[::5], "vehicle": flight.vehicle[::5]})
        common = other._replace(states=other.states[::2], time=other.time[::2])
        ledger.at_most(
            f"{name}.largest_difference_m",
            largest_difference(ours, common),
            AGREEMENT,
            "m",
            "second simulation",
        )
        cells = [Cell(f"{name}.largest_deviation_m.{i}") for i in range(len(deviations))]
        rows.append((start.title, *cells, Cell(f"{name}.largest_difference_m")))
        if key in ("equilibrium", "printed"):
            ledger.at_most(f"{name}.largest_of_all_m", max(deviations), BAND, "m", "V.A: within 0.25 m")
    std = stationary_std(load_vehicle("paper"))
    white = FORCE_STD * std_under_white_force(load_vehicle("paper"))
    unheld = "white force of the same spectrum, not held (continuous Lyapunov equation)"
    ledger.check_array(
        "figures.9.theory_std_m.load", FORCE_STD * std[3:6], white[3:6], 0.02 * white[5], "m", unheld
    )
    ledger.check(
        "figures.9.theory_std_m.vehicle_z", FORCE_STD * std[2], white[2], 0.02 * white[2], "m", unheld
    )
    worst = float(max(std[2], *std[3:6]))
    cautious = ledger.at_most(
        "figures.9.force_for_3_sigma_in_band_N", BAND / (3 * worst), 5.0, "N", "errata.md"
    )
    bold = ledger.at_least("figures.9.force_for_2_sigma_in_band_N", BAND / (2 * worst), 5.0, "N", "errata.md")
    ledger.judge(
        "figures.9",
        "V.A, fig. 9",
        "under Gaussian noise on the load x, y and z stay within 0.25 m",
        f"they do at {FORCE_STD:g} N, drawn anew every 10 ms; 0.25 m is three standard deviations at "
        f"{cautious:.1f} N, two at {bold:.1f} N",
        CORRECTED,
        "the paper gives neither the noise's size nor its bandwidth; about 5 N fits",
        ["figures.9"],
    )
    return (
        page.heading("Fig. 9: hover with noise on the load")
        + page.figure(
            _draw_noise(list(starts.values()), flights, others),
            f"<b>Fig. 9.</b> A white force of {FORCE_STD:g} N standard deviation on each axis of the load, "
            "held for "
            "10 ms. Deviations from hover; red: 0.25 m. The second simulation (dashed) gets the same force.",
            [flight.command for flight in flights],
        )
        + page.table(
            ledger,
            (
                "start",
                "load x [m]",
                "load y [m]",
                "load z [m]",
                "vehicle z [m]",
                "between the two simulations [m]",
            ),
            rows,
        )
        + page.text(
            "In the linear model the load's standard deviations are "
            + ", ".join(f"{FORCE_STD * s:.3f}" for s in std[3:6])
            + f" m, the vehicle's height's {FORCE_STD * std[2]:.3f} m. Three standard deviations of the "
            "worst reach "
            f"{BAND} m at a force of {cautious:.2f} N, two at {bold:.2f} N: “within {BAND} m” fits about 5 N."
        )
    )


def held_forces(flight: Flight) -> Array:
    """The force on the load in each hold time (n, 3), N, read off the log at the first tick in it."""
    count = round(float(flight.time[-1]) / HOLD_TIME)
    first = np.searchsorted(flight.time, np.arange(count) * HOLD_TIME - 1e-9)
    return np.asarray(flight.force_on_load[first])


def stationary_std(vehicle: Vehicle) -> Array:
    """Standard deviations (18,) of the state under the LQR, for a held white force of 1 N on the load."""
    gain, model = gains(vehicle, integral=False)
    closed = model.A - model.B @ gain
    force = np.zeros((18, 3))
    force[9:12] = np.eye(3) / vehicle.load.mass
    both = np.zeros((21, 21))
    both[:18, :18], both[:18, 18:] = closed, force
    held = linalg.expm(both * HOLD_TIME)
    covariance = linalg.solve_discrete_lyapunov(held[:18, :18], held[:18, 18:] @ held[:18, 18:].T)
    return np.asarray(np.sqrt(np.maximum(np.diag(covariance), 0.0)))


def std_under_white_force(vehicle: Vehicle) -> Array:
    """The same with a white force that is not held, of the held one's spectral density at low frequencies."""
    gain, model = gains(vehicle, integral=False)
    force = np.zeros((18, 3))
    force[9:12] = np.eye(3) / vehicle.load.mass
    covariance = linalg.solve_continuous_lyapunov(model.A - model.B @ gain, -HOLD_TIME * force @ force.T)
    return np.asarray(np.sqrt(np.maximum(np.diag(covariance), 0.0)))


def largest_deviations(load: Array, vehicle: Array) -> list[float]:
    """Largest of the load's deviations (n, 3) along x, y, z, and of the vehicle's along z, m."""
    return [*(float(v) for v in np.abs(load).max(axis=0)), float(np.abs(vehicle[:, 2]).max())]


def _hover_position(flight: Flight) -> Array:
    """Where the vehicle hovers above the reference, (n, 3), m."""
    return np.asarray(flight.reference + np.array([0.0, 0.0, flight.vehicle_description.hover_length]))


def _steady_state(context: Context) -> str:
    """What the LQR leaves when the load is heavier than it believes, and what the integrator makes of it."""
    ledger = context.ledger
    context.say("the steady-state error that motivates the integrator")
    plain, integral = context.pilot.fly(requests(context.quick)[2])
    believed, actual = load_vehicle("paper"), load_vehicle("paper", HEAVY)
    gain, _ = gains(believed, integral=False)
    # At rest: K_v dv + K_p dp = -(missing thrust), and dv - dp = the longer cable.
    missing = actual.hover_thrust - believed.hover_thrust
    longer = actual.hover_length - believed.hover_length
    sag = -(missing + gain[0, 2] * longer) / (gain[0, 2] + gain[0, 5])
    left = float(plain.load[-1, 2])
    ledger.check(
        "steady_state.lqr_load_error_m", left, float(sag), 0.02 * abs(float(sag)), "m", "-ΔT/ΣK, statics"
    )
    ledger.at_most(
        "steady_state.integral_load_error_m", float(np.abs(integral.load[-1]).max()), 1e-3, "m", "IV.D: zero"
    )
    kilo = actual.load.mass - believed.load.mass
    ledger.judge(
        "steady_state",
        "IV.D",
        "the LQR has a large steady-state error away from the equilibrium; the integrator removes it",
        f"a load heavier by {kilo:g} kg than the controller believes hangs {abs(left):.2f} m too low; with "
        "the "
        f"integrator {1e3 * abs(float(integral.load[-1, 2])):.2g} mm",
        REPRODUCED,
        "",
        ["steady_state"],
    )
    figure, axes = plots.panels(1, height=2.8)
    ax: Any = axes[0, 0]
    plots.reference(ax, plain.time, plain.reference[:, 2])
    ax.plot(plain.time, plain.load[:, 2], color=plots.LOAD, lw=1.8, label="load z, LQR (V.A)")
    ax.plot(
        integral.time,
        integral.load[:, 2],
        color=plots.LOAD,
        lw=1.8,
        ls="-.",
        label="load z, integral LQR (V.B)",
    )
    ax.axhline(float(sag), color=plots.NEUTRAL, lw=1.0, label="statics: -ΔT/ΣK")
    ax.set(xlabel="time [s]", ylabel="load z [m]")
    ax.legend(fontsize="small")
    return page.heading("Why the integrator") + page.figure(
        plots.png(figure),
        f"<b>Steady-state error.</b> The plant's load is {kilo:g} kg heavier than the controller knows. "
        "The LQR "
        f"holds it {abs(left):.2f} m too low (statics: {abs(float(sag)):.2f} m).",
        [plain.command, integral.command],
    )


def _draw_heights(starts: list[Start], flights: list[Flight], others: list[second.Run]) -> bytes:
    figure, axes = plots.panels(2, 2, height=2.6)
    for ax, start, flight, other in zip(axes.flat, starts, flights, others, strict=True):
        plots.pair(
            ax,
            plots.VEHICLE,
            "vehicle z",
            (flight.time, flight.vehicle[:, 2]),
            (other.time, other.vehicle[:, 2]),
        )
        plots.pair(ax, plots.LOAD, "load z", (flight.time, flight.load[:, 2]), (other.time, other.load[:, 2]))
        plots.reference(ax, flight.time, flight.reference[:, 2])
        ax.set_title(start.title, fontsize="medium")
        ax.set_ylabel("height z [m]")
    for ax in axes[1]:
        ax.set_xlabel("time [s]")
    plots.shared_legend(figure, axes[0, 0], columns=5)
    return plots.png(figure)


def _draw_noise(starts: list[Start], flights: list[Flight], others: list[second.Run]) -> bytes:
    figure, axes = plots.panels(3, len(starts), height=1.9, sharex=True)
    for column, (start, flight, other) in enumerate(zip(starts, flights, others, strict=True)):
        hover = _hover_position(flight)
        for axis, label in enumerate("xyz"):
            ax = axes[axis, column]
            ends = flight.reference[0], hover[0]
            for colour, name, ours, theirs, zero in (
                (plots.VEHICLE, "vehicle", flight.vehicle, other.vehicle, ends[1]),
                (plots.LOAD, "load", flight.load, other.load, ends[0]),
            ):
                plots.pair(
                    ax,
                    colour,
                    name,
                    (flight.time, ours[:, axis] - zero[axis]),
                    (other.time, theirs[:, axis] - zero[axis]),
                )
            for bound in (-BAND, BAND):
                ax.axhline(bound, color=plots.LIMIT, lw=1.0, label="0.25 m" if bound > 0 else None)
            if not column:
                ax.set_ylabel(f"{label} - hover [m]")
        axes[0, column].set_title(start.title, fontsize="small")
        axes[2, column].set_xlabel("time [s]")
    plots.shared_legend(figure, axes[0, 0], columns=5)
    return plots.png(figure)
