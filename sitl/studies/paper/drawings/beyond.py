"""The load's distance from V.B's set-point, by every law."""

from __future__ import annotations

import numpy as np

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
