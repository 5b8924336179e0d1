"""The computer in the loop: what holding the inputs and arriving late make of the paper's gains."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.design.catalogue import design, paper_weights
from controller.design.lqr import SampledGain, sampled_gain, sampled_model
from controller.design.model import LinearModel
from controller.law.reference import setpoint
from sitl.report.metrics import settling_time
from sitl.studies.paper import offline, page, plots
from sitl.studies.paper.analysis.linear_model import gains
from sitl.studies.paper.analysis.sampled_loop import (
    _radius_at,
    _roll_radius_at,
    delay_margins,
    delay_until_unstable,
    smallest_stable_rate,
    spectral_radius,
)
from sitl.studies.paper.analysis.step import TARGET, vehicle_with
from sitl.studies.paper.context import Context
from sitl.studies.paper.page import Cell
from sitl.studies.paper.record import CORRECTED, UNSUPPORTED
from sitl_bridge.vehicle.description import Vehicle

Array = NDArray[np.float64]

INPUTS = ("thrust", "M_x", "M_y", "M_z")
LENGTH = "10"
"""The design of V.B; the other is beside it in paper.json."""


STATED_RATES_HZ = (507.0, 1037.0)
"""Stated beforehand, without delay and with one sample of it: both a little on the safe side."""


def section(context: Context) -> str:
    """The section's content."""
    ledger = context.ledger
    context.say("sampling and delay")
    designs: dict[str, tuple[Vehicle, Array, LinearModel]] = {}
    for length in ("1", "10"):
        vehicle = vehicle_with(length)
        designs[length] = (vehicle, *gains(vehicle, integral=True))
    rates: dict[str, tuple[float, float]] = {}
    for length, (_, gain, model) in designs.items():
        constant = SampledGain(gain, np.zeros((0, *gain.shape[:1], gain.shape[0])))
        found = []
        for delay, name in ((0, "without_delay"), (1, "one_sample_delay")):
            rate = smallest_stable_rate(partial(_radius_at, model, constant, delay))
            alone = smallest_stable_rate(partial(_roll_radius_at, vehicle, gain, delay))
            key = f"sampling.smallest_stable_rate_hz.{length}.{name}"
            found.append(ledger.check(key, rate, alone, 2.0, "Hz", "polynomial of the roll loop alone"))
            stated = STATED_RATES_HZ[delay]
            radius = spectral_radius(model, constant, 1.0 / stated, delay)
            key = f"sampling.spectral_radius_at_{stated:.0f}_hz.{length}.{name}"
            ledger.at_most(key, radius, 1.0, "", "errata.md: stable above")
        rates[length] = (found[0], found[1])
        margins = delay_margins(model, gain)
        for i, (name, margin) in enumerate(zip(INPUTS, margins, strict=True)):
            again = delay_until_unstable(model, gain, i)
            key = f"sampling.delay_margin_s.{length}.{name}"
            ledger.check(key, margin, again, 1e-3 * again, "s", "poles with a Padé delay, bisected")
        ledger.check(
            f"sampling.smallest_delay_margin_s.{length}", min(margins), 1.5e-3, 1e-4, "s", "errata.md"
        )
    rows: list[tuple[str | Cell, ...]] = []
    for rate_hz, delay, expected, tolerance in (
        (250, 0, 3.1, 0.05),
        (500, 0, 1.02, 0.005),
        (1000, 1, 1.009, 5e-4),
    ):
        both: list[Cell] = []
        for length, (_, gain, model) in designs.items():
            constant = SampledGain(gain, np.zeros((0, 4, 4)))
            radius = spectral_radius(model, constant, 1.0 / rate_hz, delay)
            key = f"sampling.spectral_radius.{length}.{rate_hz}_hz_delay_{delay}"
            if length == "1":
                ledger.check(key, radius, expected, tolerance, "", "errata.md")
            else:
                ledger.at_least(key, radius, 1.0, "", "errata.md: unstable")
            both.append(Cell(key))
        rows.append((str(rate_hz), str(delay), *both))
    vehicle, gain, model = designs[LENGTH]
    constant = SampledGain(gain, np.zeros((0, 4, 4)))
    sampled = _sampled(context, vehicle, model)
    flown = _at_250_hz(context, vehicle, gain)
    zero, one = rates[LENGTH]
    margin = min(ledger.numbers["sampling"]["delay_margin_s"][LENGTH].values())
    ledger.judge(
        "sampling",
        "IV.C, V (implied)",
        "the gains are a controller that a vehicle could fly",
        f"held between samples they need more than {zero:.0f} Hz without any delay and {one:.0f} Hz with "
        "one sample, "
        f"and bear {1e3 * margin:.1f} ms of delay",
        UNSUPPORTED,
        "poles at -1000 rad/s: 0.01 kg m² of inertia under a 10 kg vehicle",
        [
            "sampling.smallest_stable_rate_hz",
            "sampling.smallest_delay_margin_s",
            "sampling.spectral_radius",
            "sampling.continuous_gains_at_250_hz_diverge",
        ],
    )
    ledger.judge(
        "sampling.design",
        "IV.C",
        "the cost Q, R itself",
        "minimised for the sampled loop it flies at every rate from 50 Hz on, with two samples of delay",
        CORRECTED,
        "zero-order hold and delay in the model, the cost discretised exactly",
        ["sampling.sampled_design"],
    )
    margin_rows: list[tuple[str | Cell, ...]] = [
        (name, *(Cell(f"sampling.delay_margin_s.{length}.{name}", 1e3) for length in designs))
        for name in INPUTS
    ]
    return (
        page.text(
            "A computer measures, computes and holds its output until the next sample. The paper's gains "
            "ask for poles "
            "near -1000 rad/s, which such a loop has to be fast for. Spectral radius of the loop with the "
            "paper's integral "
            "gains, held (stable below 1):"
        )
        + page.table(
            ledger, ("rate [Hz]", "samples of delay", "spectral radius, l₀ = 1 m", "l₀ = 10 m"), rows
        )
        + page.text(
            "The smallest stable rates, by bisection, and for the roll loop alone by its polynomial, are "
            f"{rates['1'][0]:.1f} Hz without delay and {rates['1'][1]:.0f} Hz with one sample for l₀ = 1 m, "
            f"{zero:.1f} and {one:.0f} Hz for l₀ = {LENGTH} m. (errata.md has {STATED_RATES_HZ[0]:.0f} and "
            f"{STATED_RATES_HZ[1]:.0f} Hz: stable too, but not the smallest.)"
        )
        + page.text("Delay that each input bears on its own, the others without any:")
        + page.table(ledger, ("input", "l₀ = 1 m [ms]", "l₀ = 10 m [ms]"), margin_rows)
        + page.figure(
            _draw(model, constant, zero, one),
            "<b>Spectral radius against sampling rate</b>, l₀ = 10 m. The paper's gains, held, and the "
            "same cost "
            "minimised for the sampled loop, each for its own rate and delay.",
        )
        + flown
        + page.heading("The same cost, minimised for the loop that exists")
        + sampled
    )


def _sampled(context: Context, vehicle: Vehicle, model: LinearModel) -> str:
    """The sampled design keeps the paper's response at every rate and delay."""
    ledger, rows = context.ledger, list[tuple[str | Cell, ...]]()
    for rate_hz in (50.0, 100.0, 250.0, 500.0, 1000.0):
        for delay in (0, 2):
            told = vehicle_with(LENGTH, f"loop.delay_ticks={delay}")
            gain = sampled_gain(sampled_model(model, paper_weights(), 1.0 / rate_hz), delay)
            radius = spectral_radius(model, gain, 1.0 / rate_hz, delay)
            slowest = math.log(radius) * rate_hz
            key = f"sampling.sampled_design.{rate_hz:.0f}_hz_delay_{delay}"
            ledger.at_most(f"{key}.spectral_radius", radius, 1.0 - 1e-6, "", "stable")
            continuous = max(p[0] for p in ledger.numbers["closed_loop_poles"]["K_integral"][LENGTH])
            ledger.check(f"{key}.slowest_pole_1_s", slowest, continuous, 0.02, "1/s", "slow poles stay")
            settled: str | Cell = ""
            if rate_hz <= 250.0:
                path = setpoint(TARGET, (0.0, 0.0, 0.0))
                run = offline.closed_loop(told, design("paper", told, rate_hz), path, 15.0, rate_hz, delay)
                error = np.linalg.norm(run.load - np.array(TARGET), axis=1)
                time = settling_time(run.time, error, 0.02 * float(error[0]))
                ledger.check(
                    f"{key}.settling_time_2pct_s", time or math.inf, 6.33, 0.15, "s", "continuous design"
                )
                settled = Cell(f"{key}.settling_time_2pct_s")
            poles = Cell(f"{key}.spectral_radius"), Cell(f"{key}.slowest_pole_1_s")
            rows.append((f"{rate_hz:g}", str(delay), *poles, settled))
    return page.table(
        ledger,
        (
            "rate [Hz]",
            "samples of delay",
            "spectral radius",
            "slowest pole [1/s]",
            "2 % settling of V.B, offline [s]",
        ),
        rows,
    )


def _at_250_hz(context: Context, vehicle: Vehicle, gain: Array) -> str:
    """The continuous gains, held at 250 Hz, on the vehicle with its rotor limits."""
    naive = design("paper", vehicle, offline.RATE_HZ)
    naive["state_gain"], naive["integral_gain"] = gain[:, :18], gain[:, 18:]
    path = setpoint(TARGET, (0.0, 0.0, 0.0))
    run = offline.closed_loop(vehicle, naive, path, 60.0)
    good = offline.closed_loop(vehicle, design("paper", vehicle, offline.RATE_HZ), path, 10.0)
    context.ledger.true("sampling.continuous_gains_at_250_hz_diverge", run.diverged, "spectral radius 3.1")
    figure, axes = plots.panels(2, 1, height=2.0, sharex=True)
    for row, (axis, label) in enumerate(((5, "load z [m]"), (16, "pitch [°]"))):
        ax: Any = axes[row, 0]
        scale, colour = (1.0, plots.LOAD) if axis == 5 else (180.0 / math.pi, plots.PITCH)
        for motion, style, name in ((run, "-", "paper's gains, held"), (good, "--", "sampled design")):
            ax.plot(motion.time, scale * motion.states[:, axis], color=colour, ls=style, label=name)
        ax.set(ylabel=label, xlim=(0, 4))
        if axis == 5:
            ax.set_ylim(-4, 4)
            ax.axhline(TARGET[2], color=plots.REFERENCE, ls=":", lw=1.4, label="reference of the load")
        ax.legend(fontsize="small")
    axes[1, 0].set_xlabel("time [s]")
    return page.figure(
        plots.png(figure),
        "<b>V.B at 250 Hz, with rotor limits.</b> Solid: the paper's continuous gains, held between "
        "samples; dashed: "
        "the same cost minimised for the sampled loop. Simulated offline.",
    )


def _draw(model: LinearModel, constant: SampledGain, *marks: float) -> bytes:
    figure, axes = plots.panels(1, height=3.4)
    ax: Any = axes[0, 0]
    rates = np.geomspace(50.0, 4000.0, 60)
    for delay, style, words in ((0, "-", "no delay"), (1, "--", "one sample of delay")):
        radii = [spectral_radius(model, constant, 1.0 / r, delay) for r in rates]
        ax.plot(rates, radii, color=plots.LIMIT, ls=style, label=f"paper's gains, held, {words}")
        some = rates[::4]
        mine = []
        for rate in some:
            gain = sampled_gain(sampled_model(model, paper_weights(), 1.0 / rate), delay)
            mine.append(spectral_radius(model, gain, 1.0 / rate, delay))
        ax.plot(some, mine, color=plots.CABLE, ls=style, label=f"sampled design, {words}")
    ax.axhline(1.0, color=plots.REFERENCE, lw=1.0)
    for mark in marks:
        ax.axvline(mark, color=plots.NEUTRAL, lw=0.8)
        ax.annotate(f"{mark:.0f} Hz", (mark, 3.0), fontsize="small", rotation=90, ha="right")
    ax.set(xscale="log", ylim=(0.9, 3.5), xlabel="sampling rate [Hz]", ylabel="spectral radius")
    ax.legend(fontsize="small")
    return plots.png(figure)
