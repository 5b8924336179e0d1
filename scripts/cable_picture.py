"""Draw docs/images/cables.png: force over strain of the ropes, and loss factor over frequency."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from sitl_bridge.vehicle.cable_law import BRANCH_SPEEDS, branches
from sitl_bridge.vehicle.cable_materials import MATERIALS

OUT = Path(__file__).parents[1] / "docs" / "images" / "cables.png"


def main() -> None:
    """Draw."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    figure, (curves, losses) = plt.subplots(1, 2, figsize=(9.0, 3.4), layout="constrained")
    speeds = 10.0 ** np.linspace(-3.0, 2.0, 400)
    x = speeds[:, None] / BRANCH_SPEEDS
    for name, material in MATERIALS.items():
        share = np.linspace(0.0, 1.0, 200)
        force = np.expm1(material.shape * share) / math.expm1(material.shape)
        curves.plot(100.0 * material.breaking_strain * share, 100.0 * force, label=name)
        weights = branches(material.loss_factor).weights
        stiffness = 1.0 + np.sum(weights * 1j * x / (1.0 + 1j * x), axis=1)
        losses.semilogx(speeds, stiffness.imag / stiffness.real, label=name)
    curves.set(
        xscale="log", xlim=(0.1, 200.0), xlabel="strain / %", ylabel="static tension / % of breaking load"
    )
    losses.set(xlabel="frequency over the bounce's", ylabel="loss factor", ylim=(0.0, None))
    for axes in (curves, losses):
        axes.grid(alpha=0.3)
    curves.legend()
    figure.savefig(OUT, dpi=120)


if __name__ == "__main__":
    main()
