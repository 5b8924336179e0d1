"""The load's distance from V.B's set-point, by every law."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from controller.law.state import Array
from sitl.studies.paper import plots
from sitl.studies.paper.analysis.step import LENGTHS
from sitl.studies.paper.flights import Flight

COLOURS = {
    "paper-lqr": plots.NEUTRAL,
    "paper": plots.VEHICLE,
    "geometric": plots.CABLE,
    "default": plots.LOAD,
}


def draw_steps(shown: list[tuple[str, str, Flight]]) -> bytes:
    figure, axes = plots.panels(1, 2, height=3.2, sharey=True)
    for law, length, flight in shown:
        ax = axes[0, LENGTHS.index(length)]
        errors = np.linalg.norm(flight.load - flight.reference, axis=1)
        style = "--" if law == "geometric" else "-"
        ax.semilogy(flight.time, errors + 1e-9, color=COLOURS[law], ls=style, label=law)
        ax.set(title=f"l₀ = {length} m", xlabel="time [s]", xlim=(0, 14), ylim=(1e-4, 10))
    for ax in axes.flat:
        ax.axhline(0.01, color=plots.REFERENCE, ls=":", lw=1.4)
    axes[0, 0].set_ylabel("distance [m]")
    plots.shared_legend(figure, axes[0, 0])
    return plots.png(figure)


class Shown(NamedTuple):
    """A motion to draw, ENU."""

    law: str
    length: str
    start: str
    time: Array
    """(n,) s"""
    vehicle: Array
    """(n, 3) m"""
    load: Array
    """(n, 3) m"""
    reference: Array
    """(n, 3) m"""


def draw_starts(shown: list[Shown]) -> bytes:
    starts, lengths = (
        list(dict.fromkeys(s.start for s in shown)),
        list(dict.fromkeys(s.length for s in shown)),
    )
    figure, axes = plots.panels(len(starts), len(lengths), height=2.6, sharey=True)
    for one in shown:
        ax = axes[starts.index(one.start), lengths.index(one.length)]
        errors = np.linalg.norm(one.load - one.reference, axis=1)
        style = "--" if one.law == "geometric" else "-"
        ax.semilogy(one.time, errors + 1e-9, color=COLOURS[one.law], ls=style, label=one.law)
        title = "at rest length" if one.start == "rest_length" else "20° aslant"
        ax.set(title=f"{title}, l₀ = {one.length} m", xlim=(0, 14), ylim=(1e-4, 10))
    for ax in axes.flat:
        ax.axhline(0.01, color=plots.REFERENCE, ls=":", lw=1.4)
    for ax in axes[-1]:
        ax.set_xlabel("time [s]")
    for ax in axes[:, 0]:
        ax.set_ylabel("distance [m]")
    plots.shared_legend(figure, axes[0, 0])
    return plots.png(figure)
