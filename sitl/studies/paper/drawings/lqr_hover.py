"""Figures 8 and 9: heights from other starts, and positions under noise."""

from __future__ import annotations

from sitl.studies.paper import independent_simulation as second
from sitl.studies.paper import plots
from sitl.studies.paper.analysis.hover_noise import (
    hover_position,
)
from sitl.studies.paper.analysis.starts import BAND, Start
from sitl.studies.paper.flights import Flight


def draw_heights(starts: list[Start], flights: list[Flight], others: list[second.Run]) -> bytes:
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


def draw_noise(starts: list[Start], flights: list[Flight], others: list[second.Run]) -> bytes:
    figure, axes = plots.panels(3, len(starts), height=1.9, sharex=True)
    for column, (start, flight, other) in enumerate(zip(starts, flights, others, strict=True)):
        hover = hover_position(flight)
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
