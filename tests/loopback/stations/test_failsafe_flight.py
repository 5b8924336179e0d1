"""One flight in which one thing after the other is lost, to the vehicle and not to a copy of its rules.

MAVProxy is the ground station, one MAVSDK flies offboard, another watches. No reaction is milder than the one
before, or it would not be seen.
"""

from __future__ import annotations

import asyncio
import json
import os
import signal
from collections.abc import Callable
from pathlib import Path

from tests.loopback.by_hand import ByHand
from tests.loopback.clients import MavProxy, Texts, Vehicle, mavsdk_vehicle, until
from tests.loopback.conftest import Process
from tests.loopback.flights import WAITS_ARMED, ready
from tests.patience import LONG_PATIENCE

AWAY = 12.0
"""m north of home, where it all goes wrong"""


async def in_mode(vehicle: Vehicle, name: str) -> None:
    await until(vehicle.telemetry.flight_mode, lambda m: m.name == name, name, LONG_PATIENCE)


async def fly_offboard_and_vanish(connection: str) -> None:
    """Fly away from home, and stop sending without a word."""
    from mavsdk.plugins.offboard import PositionNedYaw

    async with mavsdk_vehicle(connection, companion=True) as pilot:
        await pilot.offboard.set_position_ned(PositionNedYaw(AWAY, 0.0, -5.0, 0.0))
        await pilot.offboard.start()
        await until(
            pilot.telemetry.position_velocity_ned, lambda p: p.position.north_m > AWAY - 0.5, "far away"
        )
        assert (await pilot.telemetry.flight_mode()).name == "OFFBOARD"


async def stall(plant: Process, vehicle: Vehicle, texts: Texts) -> None:
    """The plant stands still until that is noticed."""
    await vehicle.param.set_param_float("COM_HIL_LOSS_T", 1.0)
    os.kill(plant.popen.pid, signal.SIGSTOP)
    try:
        await texts.wait_for("link to the plant lost")
    finally:
        os.kill(plant.popen.pid, signal.SIGCONT)
    await texts.wait_for("Sensor data are back")
    await vehicle.param.set_param_float("COM_HIL_LOSS_T", 10.0)


async def lose_everything(vehicle: ByHand, station: MavProxy) -> None:
    connection = f"udpin://127.0.0.1:{vehicle.onboard_peer}"
    async with mavsdk_vehicle(connection, companion=True) as watcher, Texts(watcher) as texts:
        await ready(watcher)
        station.say("param set MIS_TAKEOFF_ALT 5")
        station.say("arm throttle")
        at = station.wait_for("ARMED")
        station.say("long NAV_TAKEOFF 0 0 0 nan nan nan nan")
        at = station.wait_for("Mode TAKEOFF", after=at)
        await in_mode(watcher, "HOLD")

        # Battery low: said, and no more than that.
        await watcher.param.set_param_float("BAT_LOW_THR", 0.6)
        await texts.wait_for("low, warning only")
        assert (await watcher.telemetry.flight_mode()).name == "HOLD"

        # Offboard set-points lost: hold.
        await fly_offboard_and_vanish(f"udpout://127.0.0.1:{vehicle.onboard}")
        await texts.wait_for("No offboard set-point for 3 s: holding")
        await in_mode(watcher, "HOLD")

        # The plant lost and back: hold.
        await stall(vehicle.plant, watcher, texts)
        await in_mode(watcher, "HOLD")
        at = station.wait_for("Sensor data are back", after=at)

        # The only ground station lost (MAVSDK as a companion is none): return, and wait above home.
        await watcher.param.set_param_float("RTL_LAND_DELAY", -1.0)
        station.stop()
        await watcher.param.set_param_float("COM_DL_LOSS_T", 2.0)
        await texts.wait_for("No ground station for 2 s: returning")
        await in_mode(watcher, "RETURN_TO_LAUNCH")

        # Battery nearly empty: land.
        await watcher.param.set_param_float("BAT_EMERGEN_THR", 0.4)
        await texts.wait_for("emergency, landing")
        await in_mode(watcher, "LAND")
        await until(watcher.telemetry.armed, lambda armed: not armed, "landed", LONG_PATIENCE)
        assert abs((await watcher.telemetry.position()).relative_altitude_m) < 1.0


def test_everything_is_lost_one_after_the_other(start: Callable[..., Process], tmp_path: Path) -> None:
    stored = tmp_path / "parameters.json"
    # A busy machine's pauses are no loss before one is meant.
    stored.write_text(
        json.dumps({"COM_HIL_LOSS_T": 10.0, "COM_DL_LOSS_T": 300.0, "COM_OF_LOSS_T": 3.0, **WAITS_ARMED})
    )
    vehicle = ByHand(
        start,
        ("--set", "battery.charge=0.39"),  # under the highest threshold of an emergency
        ("--parameters", str(stored)),
        speed=4.0,
    )
    station = MavProxy(f"udp:127.0.0.1:{vehicle.gcs_peer}", tmp_path)
    try:
        asyncio.run(lose_everything(vehicle, station))
    finally:
        station.stop()
