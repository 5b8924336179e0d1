"""How the page draws: the same colour for the same thing on every plot, and PNG bytes out."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

VEHICLE = "tab:blue"
LOAD = "tab:orange"
CABLE = "tab:green"
REFERENCE = "black"
LIMIT = "tab:red"
ROLL, PITCH, YAW = "tab:purple", "tab:brown", "tab:pink"
"""Euler angles; inputs and axes of rotation have the colour of their angle."""
NEUTRAL = "tab:gray"

OURS: dict[str, Any] = {"lw": 4.0, "alpha": 0.4}
"""Our curve: broad and pale, so that the second one shows on top of it."""
SECOND: dict[str, Any] = {"lw": 1.2, "ls": "--"}
"""The second, independent curve: thin and dashed."""


def panels(rows: int, columns: int = 1, height: float = 2.2, width: float = 9.5, **options: Any) -> Any:
    """(figure, axes array of shape (rows, columns)), with a light grid."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(
        rows, columns, figsize=(width, height * rows), layout="constrained", squeeze=False, **options
    )
    for ax in axes.flat:
        ax.grid(alpha=0.3)
    return figure, axes


def png(figure: Any) -> bytes:
    """The figure as PNG; it is closed."""
    from matplotlib import pyplot as plt

    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=100)
    plt.close(figure)
    return out.getvalue()


def pair(ax: Any, colour: str, name: str, ours: tuple[Array, Array], second: tuple[Array, Array]) -> None:
    """One quantity from both simulations: (time, values) of each."""
    ax.plot(*ours, color=colour, label=name, **OURS)
    ax.plot(*second, color=colour, label=f"{name}, second simulation", **SECOND)


def reference(ax: Any, time: Array, values: Array) -> None:
    """The load's reference."""
    ax.plot(time, values, color=REFERENCE, ls=":", lw=1.4, label="reference of the load")


def shared_legend(figure: Any, ax: Any, columns: int = 4) -> None:
    """One legend for all panels, above them."""
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=columns, fontsize="small")
