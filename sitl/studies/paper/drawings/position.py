"""Figure 10: positions, cable length and rotors along the step."""

from __future__ import annotations

import numpy as np

from sitl.studies.paper import independent_simulation as second
from sitl.studies.paper import plots
from sitl.studies.paper.analysis.step import LENGTHS
from sitl.studies.paper.flights import Flight


def draw_setpoint(flights: list[Flight], others: list[second.Run]) -> bytes:
    figure, axes = plots.panels(4, 2, height=1.9, sharex=True)
    order = [LENGTHS.index("10"), LENGTHS.index("1")]
    for column, index in enumerate(order):
        flight, other = flights[index], others[index]
        for axis, label in enumerate("xyz"):
            ax = axes[axis, column]
            for colour, name, ours, theirs in (
                (plots.VEHICLE, "vehicle", flight.vehicle, other.vehicle),
                (plots.LOAD, "load", flight.load, other.load),
            ):
                plots.pair(ax, colour, name, (flight.time, ours[:, axis]), (other.time, theirs[:, axis]))
            plots.reference(ax, flight.time, flight.reference[:, axis])
            ax.set_ylabel(f"{label} [m]")
        ax = axes[3, column]
        lengths = [np.linalg.norm(run.vehicle - run.load, axis=1) for run in (flight, other)]
        plots.pair(ax, plots.CABLE, "cable length", (flight.time, lengths[0]), (other.time, lengths[1]))
        ax.set(xlabel="time [s]", ylabel="cable length [m]")
        axes[0, column].set(title=f"l₀ = {LENGTHS[index]} m", xlim=(0, 15))
    plots.shared_legend(figure, axes[0, 0], columns=5)
    return plots.png(figure)
