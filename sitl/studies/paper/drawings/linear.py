"""Poles of the open and the closed loop."""

from __future__ import annotations

from typing import Any

from sitl.studies.paper import plots


def draw_poles(open_loop: Any, closed: dict[str, Any]) -> bytes:
    figure, axes = plots.panels(1, height=3.6)
    ax: Any = axes[0, 0]
    ax.plot(open_loop.real, open_loop.imag, "x", color=plots.REFERENCE, ms=9, label="open loop, l₀ = 1 m")
    labels = {
        "K_lqr": ("LQR, V.A, l₀ = 1 m", "o", plots.VEHICLE),
        "K_integral.1": ("integral LQR, l₀ = 1 m", "s", plots.LOAD),
        "K_integral.10": ("integral LQR, V.B, l₀ = 10 m", "^", plots.CABLE),
    }
    for key, poles in closed.items():
        label, marker, colour = labels[key]
        ax.plot(poles.real, poles.imag, marker, color=colour, mfc="none", label=label)
    ax.set(xlim=(-4, 0.5), xlabel="real part [1/s]", ylabel="imaginary part [rad/s]")
    ax.axvline(0.0, color=plots.LIMIT, lw=0.8)
    ax.legend(fontsize="small", loc="center left")
    return plots.png(figure)
