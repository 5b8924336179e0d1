"""The picture of docs/delivery.md, from the state log of a delivery flown by examples/delivery.py.

sitl fly hold --sensors rtk --out runs/delivery &
python examples/delivery.py
python scripts/delivery_picture.py runs/delivery/state.parquet docs/images/delivery.png
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
from sitl.studies.paper.plots import CABLE, LOAD, VEHICLE, panels, png  # noqa: E402

EVERY = 2.5
"""s between two cables that are drawn"""
PULLS = 0.05
"""N, tension of a cable that is drawn as taut"""


def picture(log: Path) -> bytes:
    """PNG: the flight from the side, and what hangs on the cable over time."""
    table = parquet.read_table(log)
    time, north, up, load_north, load_up, tension = (
        np.asarray(table[name])
        for name in ("time_s", "vehicle_y_m", "vehicle_z_m", "load_y_m", "load_z_m", "cable_tension_N")
    )
    figure, axes = panels(2, height=3.2, gridspec_kw={"height_ratios": [2.2, 1.0]})
    side, pull = axes[:, 0]
    for moment in np.arange(time[0], time[-1], EVERY):
        i = int(np.searchsorted(time, moment))
        if tension[i] > PULLS:
            side.plot([north[i], load_north[i]], [up[i], load_up[i]], color=CABLE, lw=0.8, alpha=0.6)
    side.plot(north, up, color=VEHICLE, label="vehicle")
    side.plot(load_north, load_up, color=LOAD, label="load")
    side.set(xlabel="north / m", ylabel="height / m", aspect="equal", ylim=(-0.3, None))
    side.legend(loc="lower center")
    pull.plot(time, up, color=VEHICLE, label="height of the vehicle / m")
    pull.plot(time, load_up, color=LOAD, label="height of the load / m")
    pull.plot(time, tension, color=CABLE, lw=0.8, label="tension / N")
    pull.set(xlabel="time / s", xlim=(time[0], time[-1]))
    pull.legend(loc=(0.53, 0.3), fontsize="small")
    return png(figure)


def main() -> None:
    """Draw."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("log", type=Path, help="state log of the flight")
    parser.add_argument("picture", type=Path, help="PNG to write")
    arguments = parser.parse_args()
    arguments.picture.write_bytes(picture(arguments.log))


if __name__ == "__main__":
    main()
