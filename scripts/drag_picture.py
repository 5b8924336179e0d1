"""Draws docs/images/drag.png: a drag and a lift, as tests/plant/physics/test_ground_flight.py flies them.

python scripts/drag_picture.py
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from sitl_bridge.plant.physics.state import LOAD_GROUND_FORCE, TENSION  # noqa: E402
from tests.plant.physics.test_ground_flight import PERIOD, flown  # noqa: E402


def main() -> None:
    """Fly and draw."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.parse_args()
    _, logs = flown()
    figure, (side, over_time) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    began = 0.0
    for (name, log), colour in zip(
        logs.items(), plt.cm.viridis(np.linspace(0, 0.95, len(logs))), strict=True
    ):
        x, felt = np.array(log.states), np.array(log.reactions)
        side.plot(x[:, 0], x[:, 2], color=colour, label=name)
        side.plot(x[:, 13], x[:, 15], color=colour, linestyle="--")
        if name in ("drag", "lift"):
            for row in x[:: len(x) // 6]:
                side.plot(row[[0, 13]], row[[2, 15]], color="0.8", linewidth=0.6, zorder=0)
        times = began + PERIOD * np.arange(len(x))
        over_time.axvline(began, color="0.85", linewidth=0.8)
        over_time.text(began + 0.2, 6.1, name, rotation=90, va="top", fontsize=8, color="0.4")
        tension, ground = felt[:, TENSION], felt[:, LOAD_GROUND_FORCE]
        over_time.plot(times, tension, color="tab:blue", label="cable tension" if not began else None)
        over_time.plot(times, ground, color="tab:orange", label="ground on load" if not began else None)
        began = times[-1] + PERIOD
    side.axhline(0.0, color="0.4", linewidth=0.8)
    side.set(
        xlabel="east / m", ylabel="up / m", aspect="equal", title="vehicle (solid), load (dashed), cable"
    )
    side.legend(fontsize=8)
    over_time.set(xlabel="t / s", ylabel="force / N", ylim=(-0.2, 6.3))
    over_time.legend(fontsize=8, loc="center right")
    figure.savefig(ROOT / "docs" / "images" / "drag.png", dpi=110)


if __name__ == "__main__":
    main()
