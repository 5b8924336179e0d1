"""Section V.A, figs. 8 and 9: the LQR at hover, without and with noise; its steady-state error."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl.studies.paper import independent_simulation as second
from sitl.studies.paper import page, plots
from sitl.studies.paper.analysis.hover_noise import (
    FORCE_STD,
    HOLD_TIME,
    held_forces,
    hover_position,
    largest_deviations,
    stationary_std,
    std_under_white_force,
)
from sitl.studies.paper.analysis.linear_model import gains, hover_point
from sitl.studies.paper.analysis.starts import (
    BAND,
    STARTS,
    largest_difference,
    noisy_starts,
    settling_heights,
)
from sitl.studies.paper.context import Context
from sitl.studies.paper.drawings.lqr_hover import draw_heights, draw_noise
from sitl.studies.paper.flights import Flight, Request
from sitl.studies.paper.page import Cell
from sitl.studies.paper.record import CORRECTED, REPRODUCED
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle

Array = NDArray[np.float64]

AGREEMENT = 1e-3
"""Flown at 250 Hz against the paper's continuous law in the second simulation, m."""


NOISE = (f"disturbance.force_std={FORCE_STD:g}", "disturbance.acts_on=load")
HEAVY = ("load.mass=11",)
"""Of the plant alone: heavier than the controller knows."""


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
            draw_heights(list(STARTS.values()), flights, others),
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
        hover = hover_position(flight)
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
            draw_noise(list(starts.values()), flights, others),
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
