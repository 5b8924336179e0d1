"""Draws docs/images/lift-off.png: the autopilot takes off with its load, hovers, and lands.

python scripts/lift_off_picture.py

Plant and controller as processes of their own, in lockstep; MAVSDK says what to do.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pyarrow.parquet as pq
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from sitl.testing import flying_vehicle  # noqa: E402

HEIGHT, HOVER = 3.0, 6.0
"""m and s."""
WEIGHT = 0.3 * 9.81
"""N, of the load."""


async def command(connection: str) -> None:
    """Take off, hover, land."""
    async with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
        await mavsdk.add_any_connection(connection)
        system = await mavsdk.first_autopilot(timeout_s=20)
        if system is None:
            sys.exit("no vehicle")
        action, telemetry = ActionAsync(system), TelemetryAsync(system)
        while not (await telemetry.health()).is_armable:
            await asyncio.sleep(0.2)
        await action.set_takeoff_altitude(HEIGHT)
        await action.arm()
        await action.takeoff()
        for mode in ("TAKEOFF", "HOLD"):  # it stood in HOLD
            while (await telemetry.flight_mode()).name != mode:
                await asyncio.sleep(0.1)
        await asyncio.sleep(HOVER)
        await action.land()
        while await telemetry.armed():
            await asyncio.sleep(0.2)
        await asyncio.sleep(1.0)


def fly() -> dict[str, NDArray[np.float64]]:
    """The flight's log, by column."""
    with tempfile.TemporaryDirectory() as folder:
        with flying_vehicle(Path(folder)) as vehicle:
            asyncio.run(command(vehicle.mavsdk))
        table = pq.read_table(vehicle.state_log)
        return {name: table[name].to_numpy() for name in table.column_names}


def main() -> None:
    """Fly and draw."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.parse_args()
    log = fly()
    time = log["time_s"]
    east, up = log["vehicle_x_m"], log["vehicle_z_m"]
    load_east, load_up = log["load_x_m"], log["load_z_m"]
    top = int(np.argmax(load_up))
    figure, (ascent, heights) = plt.subplots(
        1, 2, figsize=(10, 4.5), layout="constrained", width_ratios=(1, 2.2)
    )
    ascent.plot(east[:top], up[:top], label="vehicle")
    ascent.plot(load_east[:top], load_up[:top], "--", label="load")
    moving = np.flatnonzero(up[:top] > up[0] + 0.05)
    for row in np.linspace(moving[0], top, 12).astype(int):
        ascent.plot(
            [east[row], load_east[row]], [up[row], load_up[row]], color="0.75", linewidth=0.8, zorder=0
        )
    ascent.axhline(0.0, color="0.4", linewidth=0.8)
    ascent.set(xlabel="east / m", ylabel="up / m", aspect="equal", title="take-off (grey: vehicle to load)")
    ascent.set_xlim(-0.25, 1.25)
    ascent.legend(fontsize=8, loc="upper left")
    heights.plot(time, up, label="vehicle, height / m")
    heights.plot(time, load_up, "--", label="load, height / m")
    heights.plot(time, log["cable_tension_N"], color="tab:red", linewidth=0.8, label="cable tension / N")
    heights.axhline(WEIGHT, color="tab:red", linestyle=":", linewidth=0.8)
    heights.text(0.0, WEIGHT, "load's weight", fontsize=8, va="bottom", color="tab:red")
    heights.set(xlabel="t / s", title="take-off, hover, landing")
    heights.legend(fontsize=8, loc=(0.02, 0.55))
    heights.grid(alpha=0.3)
    figure.savefig(ROOT / "docs" / "images" / "lift-off.png", dpi=110)


if __name__ == "__main__":
    main()
