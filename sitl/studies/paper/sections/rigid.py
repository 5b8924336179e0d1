"""What a controller designed for a rigid cable does on an elastic one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from controller.design.catalogue import paper_weights
from controller.design.lqr import Weights, continuous_gain
from controller.design.model import LinearModel, linear_model, with_integrator
from sitl.studies.paper import independent_simulation as second
from sitl.studies.paper import page, plots
from sitl.studies.paper.analysis.linear_model import hover_point
from sitl.studies.paper.analysis.step import TARGET, law, vehicle_with
from sitl.studies.paper.context import Context
from sitl.studies.paper.record import REPRODUCED
from sitl_bridge.vehicle.description import Vehicle

Array = NDArray[np.float64]

LENGTH = "1"
"""l₀, m."""
FEEDBACKS = ("load", "vehicle")
"""Whose height, climb rate and integral the controller is fed with."""
Z_VEHICLE, Z_LOAD, CLIMB_VEHICLE, CLIMB_LOAD, INTEGRAL_Z = 2, 5, 8, 11, 20


def rigid_motions() -> Array:
    """The motions (21, 19) that a rigid cable allows: vehicle and load share height and climb rate.

    Deviations in the order of eq. 31 and the integral, from the same without
    the load's height and climb rate.
    """
    columns = np.eye(21)
    columns[Z_LOAD, Z_VEHICLE] = columns[CLIMB_LOAD, CLIMB_VEHICLE] = 1.0
    return np.delete(columns, [Z_LOAD, CLIMB_LOAD], axis=1)


def rigid_gain(vehicle: Vehicle, feedback: str) -> Array:
    """Gain (4, 21) of the paper's cost for the same vehicle on a rigid cable of length l₀.

    feedback: `load` or `vehicle`, the body whose height the gain acts on.
    """
    elastic = with_integrator(linear_model(vehicle, thrust=vehicle.hover_thrust))
    allowed = rigid_motions()
    a = elastic.A.copy()
    # Sideways the tension at hover acts over l₀; along the cable its force is internal and drops out.
    string = vehicle.load.mass * vehicle.gravity / vehicle.cable.rest_length
    for axis in (0, 1):
        for row, sign, mass in ((6, -1.0, vehicle.airframe.mass), (9, 1.0, vehicle.load.mass)):
            a[row + axis, axis], a[row + axis, 3 + axis] = sign * string / mass, -sign * string / mass
    masses = np.ones(21)
    masses[[Z_VEHICLE, CLIMB_VEHICLE]] = vehicle.airframe.mass
    masses[[Z_LOAD, CLIMB_LOAD]] = vehicle.load.mass
    # Project along the constraint force: weigh with the masses.
    project = np.linalg.solve(allowed.T @ (masses[:, None] * allowed), allowed.T * masses)
    weights = paper_weights()
    model = LinearModel(project @ a @ allowed, project @ elastic.B)
    gain = continuous_gain(model, Weights(allowed.T @ weights.Q @ allowed, weights.R))
    full = gain @ np.delete(np.eye(21), [Z_LOAD, CLIMB_LOAD], axis=0)  # on the vehicle's height
    if feedback == "load":
        full[:, [Z_VEHICLE, Z_LOAD]] = full[:, [Z_LOAD, Z_VEHICLE]]
        full[:, [CLIMB_VEHICLE, CLIMB_LOAD]] = full[:, [CLIMB_LOAD, CLIMB_VEHICLE]]
    return np.asarray(full)


def growth(vehicle: Vehicle, feedback: str, again: bool = False) -> float:
    """Largest real part, 1/s, of the elastic loop under the rigid cable's controller.

    again: with the second simulation's numerical Jacobian in place of our model.
    """
    model = linear_model(vehicle)
    if again:
        wrench = (vehicle.hover_thrust, 0.0, 0.0, 0.0)
        model = LinearModel(*second.jacobians(vehicle, hover_point(vehicle), wrench))
    model = with_integrator(model)
    a = model.A.copy()
    if feedback == "vehicle":
        a[INTEGRAL_Z, [Z_LOAD, Z_VEHICLE]] = a[INTEGRAL_Z, [Z_VEHICLE, Z_LOAD]]
    return float(np.linalg.eigvals(a - model.B @ rigid_gain(vehicle, feedback)).real.max())


def on_cable(*overrides: str) -> Vehicle:
    """The paper's vehicle with l₀ = LENGTH and these overrides."""
    return vehicle_with(LENGTH, *overrides)


def crossing(key: str, low: float, high: float, feedback: str, *more: str, again: bool = False) -> float:
    """The value of `cable.<key>` between low (unstable) and high (stable) where the loop becomes stable."""

    def at(log_value: float) -> float:
        return growth(on_cable(f"cable.{key}={math.exp(log_value)!r}", *more), feedback, again)

    return float(math.exp(brentq(at, math.log(low), math.log(high), xtol=1e-6)))


def section(context: Context) -> str:
    """The section's content."""
    ledger = context.ledger
    context.say("elasticity: a controller for a rigid cable")
    grid = np.geomspace(20.0, 1e5, 25)
    growths = {
        feedback: np.array([growth(on_cable(f"cable.stiffness={k!r}"), feedback) for k in grid.tolist()])
        for feedback in FEEDBACKS
    }
    vehicle = on_cable()
    times = np.linspace(0.0, 15.0, 751)
    runs = {feedback: second.fly(vehicle, _law(vehicle, feedback), times) for feedback in FEEDBACKS}
    elastic = second.fly(vehicle, law(vehicle, lambda _: TARGET), times)
    name = "elasticity_rigid_controller"
    linmod = "second simulation's linmod"
    ledger.put(f"{name}.stiffness_N_m", grid, "N/m", "chosen: values of the sweep, not results")
    for feedback in FEEDBACKS:
        again = [growth(on_cable(f"cable.stiffness={k!r}"), feedback, again=True) for k in grid.tolist()]
        key = f"{name}.{feedback}_height.largest_real_part_1_s"
        ledger.check_array(key, growths[feedback], again, 1e-3, "1/s", linmod)
    ledger.at_least(
        f"{name}.load_height.smallest_growth_1_s", float(growths["load"].min()), 0.05, "1/s", "not collocated"
    )
    ledger.true(f"{name}.load_height.diverges_in_the_nonlinear_model", runs["load"].diverged, "its poles")
    needed, stiff = (
        ledger.check(
            f"{name}.load_height.damping_needed_at_{words}_N_m_Ns_m",
            crossing("damping", 10.0, 100.0, "load", f"cable.stiffness={words}"),
            crossing("damping", 10.0, 100.0, "load", f"cable.stiffness={words}", again=True),
            0.01,
            "N s/m",
            linmod,
        )
        for words in ("100", "1e5")
    )
    ledger.check(
        f"{name}.load_height.damping_needed_at_1e5_N_m_over_at_100",
        stiff / needed,
        1.0,
        0.15,
        "",
        "stiffness: no help",
    )
    limit = ledger.check(
        f"{name}.vehicle_height.stable_above_N_m",
        crossing("stiffness", 20.0, 1000.0, "vehicle"),
        crossing("stiffness", 20.0, 1000.0, "vehicle", again=True),
        0.01,
        "N/m",
        linmod,
    )
    ledger.at_most(
        f"{name}.vehicle_height.stable_at_100_N_m_1_s", growth(vehicle, "vehicle"), -0.05, "1/s", "collocated"
    )
    ledger.at_most(
        f"{name}.vehicle_height.largest_growth_above_100_N_m_1_s",
        float(growths["vehicle"][grid >= 100.0].max()),
        -0.05,
        "1/s",
        "collocated",
    )
    stretch = vehicle.hover_length - vehicle.cable.rest_length
    left = float(TARGET[2] - runs["vehicle"].load[-1, 2])
    ledger.check(f"{name}.vehicle_height.load_too_low_m", left, stretch, 0.01, "m", "m_p g/k_a")
    ledger.judge(
        "elasticity.rigid",
        "I (motivation)",
        "treating the cable as a rigid link lacks accuracy",
        "worse than that: fed with the load's height, a rigid cable's controller is unstable on the cable "
        "of Table "
        f"I at every stiffness; fed with the vehicle's height it flies above {limit:.0f} N/m, with the "
        f"load {left:.2f} m "
        "too low at 100 N/m",
        REPRODUCED,
        "between load and thrust lies the spring: what damps the whole drives the bounce",
        [name],
    )
    return (
        page.heading("A controller for a rigid cable, on an elastic one")
        + page.figure(
            _draw(grid, growths, runs, elastic),
            "<b>Designed for a rigid cable of l₀ = 1 m</b>, the paper's weights on the motions that it "
            "allows. "
            "Left: largest "
            "real part of the linear loop, fed with the height, climb rate and integral of the load or of "
            "the "
            "vehicle. "
            "Right: V.B at 100 N/m, nonlinear, offline (load z; with the load's height it tips over).",
        )
        + page.text(
            "The rigid controller cannot tell the load's height from the vehicle's. Fed with the load's, its "
            "damping of the "
            "whole acts on the bounce with the wrong sign, for vehicle and load then move against each "
            "other; "
            "by the same "
            "amount however stiff the cable is, so that a stiffer cable does not help: only damping does, "
            "from "
            f"c_a = {needed:.1f} N s/m on at 100 N/m, and from {stiff:.1f} N s/m on at 1e5 N/m. "
            "Fed with the vehicle's, thrust and sensor are at the same place and the bounce stays damped; "
            f"below {limit:.0f} "
            "N/m the cable is so much longer than l₀ that the pendulum is misjudged, and the load hangs too "
            "low by the "
            f"stretch, {left:.3f} m at 100 N/m."
        )
    )


def _draw(grid: Array, growths: dict[str, Array], runs: dict[str, second.Run], elastic: second.Run) -> bytes:
    figure, axes = plots.panels(1, 2, height=3.4)
    ax: Any = axes[0, 0]
    for feedback, colour in (("load", plots.LOAD), ("vehicle", plots.VEHICLE)):
        ax.plot(grid, growths[feedback], color=colour, label=f"fed with the {feedback}'s height")
    ax.axhline(0.0, color=plots.LIMIT, lw=1.0, label="unstable above")
    ax.set(xscale="log", xlabel="stiffness k_a [N/m]", ylabel="largest real part [1/s]")
    ax.legend(fontsize="small")
    ax = axes[0, 1]
    plots.reference(ax, elastic.time, np.full(len(elastic.time), TARGET[2]))
    for run, style, label in (
        (elastic, "-", "elastic design"),
        (runs["vehicle"], "--", "rigid design, vehicle's height"),
        (runs["load"], ":", "rigid design, load's height"),
    ):
        ax.plot(run.time, run.load[:, 2], color=plots.LOAD, ls=style, lw=1.8, label=f"load z, {label}")
    ax.set(xlabel="time [s]", ylabel="load z [m]", ylim=(-2, 6))
    ax.legend(fontsize="small", loc="upper right")
    return plots.png(figure)


def _law(vehicle: Vehicle, feedback: str) -> second.Law:
    """The rigid cable's controller for V.B: reference through the integrator."""
    x_star = hover_point(vehicle, vehicle.cable.rest_length)  # it knows of no stretch
    if feedback == "load":
        x_star = hover_point(vehicle)

    def integrates(_: float, x: Array, reference: second.Three) -> second.Three:
        height = x[Z_LOAD] if feedback == "load" else x[Z_VEHICLE] - vehicle.cable.rest_length
        return (float(x[3]) - reference[0], float(x[4]) - reference[1], float(height) - reference[2])

    u_star = np.array([vehicle.hover_thrust, 0.0, 0.0, 0.0])
    return second.Law(rigid_gain(vehicle, feedback), x_star, u_star, lambda _: TARGET, integrates=integrates)
