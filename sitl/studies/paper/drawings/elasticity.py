"""Sweeps over stiffness, and growths under gains for another cable."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from controller.law.state import Array
from sitl.studies.paper import plots
from sitl.studies.paper.analysis.linear_model import damping_ratio
from sitl.studies.paper.analysis.stiffness import (
    Response,
)


def draw_stiffness(table: dict[float, Response], flown: Sequence[Sequence[Any]]) -> bytes:
    figure, axes = plots.panels(2, 2, height=2.6, sharex=True)
    ks = list(table)
    rings: dict[str, Any] = {"ls": "", "marker": "o", "ms": 11, "mfc": "none"}
    ax: Any = axes[0, 0]
    ax.loglog(
        ks, [abs(r.bounce) / (2 * math.pi) for r in table.values()], ".-", color=plots.CABLE, label="bounce"
    )
    ax.loglog(
        ks, [r.pendulum / (2 * math.pi) for r in table.values()], ".-", color=plots.LOAD, label="pendulum"
    )
    ax.set_ylabel("open-loop frequency [Hz]")
    ax = axes[0, 1]
    ax.loglog(
        ks,
        [damping_ratio(r.bounce) for r in table.values()],
        ".-",
        color=plots.CABLE,
        label="bounce, open loop",
    )
    closed = [damping_ratio(r.bounce_closed) for r in table.values()]
    ax.loglog(ks, closed, ".--", color=plots.CABLE, label="closed loop")
    ax.set_ylabel("damping ratio")
    ax = axes[1, 0]
    ax.semilogx(ks, [r.settling for r in table.values()], ".-", color=plots.LOAD, label="offline")
    ax.semilogx(
        [row[0] for row in flown], [row[1] for row in flown], color=plots.LOAD, label="flown", **rings
    )
    ax.set(xlabel="stiffness k_a [N/m]", ylabel="2 % settling time [s]", ylim=(0, None))
    ax = axes[1, 1]
    ax.semilogx(ks, [r.peak_tension for r in table.values()], ".-", color=plots.CABLE, label="offline")
    ax.semilogx(
        [row[0] for row in flown], [row[2] for row in flown], color=plots.CABLE, label="flown", **rings
    )
    ax.axhline(98.1, color=plots.NEUTRAL, lw=1.0, label="weight of the load")
    ax.set(xlabel="stiffness k_a [N/m]", ylabel="peak tension [N]", ylim=(0, None))
    for ax in axes.flat:
        ax.legend(fontsize="small")
    return plots.png(figure)


def draw_crossed(growths: Array, values: Sequence[float], label: str) -> bytes:
    figure, axes = plots.panels(1, height=3.6, width=6.5)
    ax: Any = axes[0, 0]
    ax.grid(False)
    image = ax.imshow(growths, cmap="RdBu_r", vmin=-1.5, vmax=1.5, aspect="auto")
    names = [f"{v:g}" for v in values]
    ax.set_xticks(range(len(values)), names)
    ax.set_yticks(range(len(values)), names)
    for (i, j), growth in np.ndenumerate(growths):
        colour = "white" if abs(growth) > 0.9 else "black"
        ax.text(j, i, f"{growth:.2f}", ha="center", va="center", fontsize=8, color=colour)
    ax.set(xlabel=f"flown on {label}", ylabel=f"designed for {label}")
    figure.colorbar(image, label="growth rate [1/s]")
    return plots.png(figure)
