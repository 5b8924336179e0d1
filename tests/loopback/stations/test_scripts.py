"""The calls of MAVSDK's examples that steer by attitude, sticks, orbit and target, and that read files."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

from controller.ground.parameters.table import TABLE
from sitl.testing import flying_vehicle
from tests.loopback.clients import Vehicle, mavsdk_vehicle, until
from tests.loopback.flights import METRES_PER_DEGREE, ready
from tests.patience import LONG_PATIENCE

HOLDS_WITHOUT_STICKS = {"COM_RCL_EXCEPT": 2}


async def mode(vehicle: Vehicle, name: str) -> None:
    """Wait for a flight mode."""
    await until(vehicle.telemetry.flight_mode, lambda m: m.name == name, f"mode {name}")


async def steer_by_attitude(vehicle: Vehicle) -> None:
    """From the ground: no thrust, much thrust, hover, a turn by body rates; then Hold picks the load up."""
    from mavsdk.plugins.offboard import Attitude, AttitudeRate

    hover = await vehicle.param.get_param_float("MPC_THR_HOVER")
    await vehicle.action.arm()
    await vehicle.offboard.set_attitude(Attitude(0.0, 0.0, 0.0, 0.0))
    await vehicle.offboard.start()
    await mode(vehicle, "OFFBOARD")
    await vehicle.offboard.set_attitude(Attitude(0.0, 0.0, 0.0, 1.15 * hover))
    await until(vehicle.telemetry.position, lambda p: p.relative_altitude_m > 2.5, "up by thrust")
    await vehicle.offboard.set_attitude(Attitude(0.0, 0.0, 0.0, hover))
    await vehicle.offboard.set_attitude_rate(AttitudeRate(0.0, 0.0, 30.0, hover))
    await until(
        vehicle.telemetry.attitude_angular_velocity_body, lambda w: w.yaw_rad_s > 0.3, "turns by body rates"
    )
    await vehicle.offboard.stop()
    await mode(vehicle, "HOLD")
    await asyncio.sleep(2.0)
    await until(vehicle.telemetry.position_velocity_ned, lambda p: _speed(p) < 0.2, "at rest with the load")


async def fly_an_orbit(vehicle: Vehicle) -> None:
    """Round the place where the vehicle is, by MAVSDK's do_orbit."""
    from mavsdk.plugins.action import OrbitYawBehavior

    here = await vehicle.telemetry.position()
    centre = here.latitude_deg, here.longitude_deg
    yaw = OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER
    await vehicle.action.do_orbit(4.0, 2.0, yaw, *centre, here.absolute_altitude_m + 3.0)
    await until(lambda: away(vehicle, centre), lambda d: abs(d - 4.0) < 0.3, "on the circle")
    await asyncio.sleep(6.0)  # the load comes to rest on its own circle
    for _ in range(10):
        await asyncio.sleep(0.3)
        assert abs(await away(vehicle, centre) - 4.0) < 0.3
    await vehicle.action.hold()


async def away(vehicle: Vehicle, centre: tuple[float, float]) -> float:
    """Horizontal distance from a place (degrees), m."""
    p = await vehicle.telemetry.position()
    north = (p.latitude_deg - centre[0]) * METRES_PER_DEGREE
    east = (p.longitude_deg - centre[1]) * METRES_PER_DEGREE * math.cos(math.radians(centre[0]))
    return math.hypot(north, east)


@contextlib.asynccontextmanager
async def sticks(vehicle: Vehicle) -> AsyncIterator[list[float]]:
    """Sticks that are sent at 20 Hz: pitch, roll, throttle, yaw, to be changed in place."""
    from mavsdk.asyncio.plugins.manual_control import ManualControlAsync

    control = ManualControlAsync(vehicle.system)
    axes = [0.0, 0.0, 0.5, 0.0]

    async def send() -> None:
        while True:
            await control.set_manual_control_input(*axes)
            await asyncio.sleep(0.05)

    task = asyncio.create_task(send())
    await asyncio.sleep(0.3)
    await control.start_position_control()
    try:
        yield axes
    finally:
        task.cancel()


async def fly_by_sticks(vehicle: Vehicle) -> None:
    """Forward, and let go."""
    async with sticks(vehicle) as axes:
        await mode(vehicle, "POSCTL")
        axes[0] = 0.8
        await until(vehicle.telemetry.position_velocity_ned, lambda p: _speed(p) > 1.5, "forward by stick")
        axes[0] = 0.0
        await until(vehicle.telemetry.position_velocity_ned, lambda p: _speed(p) < 0.2, "stopped by stick")
        await vehicle.action.hold()
    await mode(vehicle, "HOLD")


def _speed(p: Any) -> float:
    return math.hypot(p.velocity.north_m_s, p.velocity.east_m_s)


async def follow(vehicle: Vehicle) -> None:
    """Somebody who stands 12 m to the north."""
    from mavsdk.asyncio.plugins.follow_me import FollowMeAsync
    from mavsdk.plugins.follow_me import Config, TargetLocation

    me = FollowMeAsync(vehicle.system)
    await me.set_config(Config(8.0, 3.0, 0.1, 0, 5.0, 180.0))
    here = await vehicle.telemetry.position()
    target = (here.latitude_deg + 12.0 / METRES_PER_DEGREE, here.longitude_deg)
    await me.start()
    await mode(vehicle, "FOLLOW_ME")
    await me.set_target_location(TargetLocation(*target, here.absolute_altitude_m, 0.0, 0.0, 0.0))
    await until(
        lambda: away(vehicle, target), lambda d: abs(d - 3.0) < 0.3, "beside the target", LONG_PATIENCE
    )
    await me.stop()
    await mode(vehicle, "HOLD")


async def read_files(vehicle: Vehicle, folder: Path) -> None:
    """Metadata by FTP, and the list of logs."""
    from mavsdk.asyncio.plugins.ftp import FtpAsync
    from mavsdk.asyncio.plugins.log_files import LogFilesAsync

    ftp = FtpAsync(vehicle.system)
    assert {e.name for e in (await ftp.list_directory("/")).entries} == {"@PARAM", "etc", "log"}
    for burst in (True, False):
        async for _ in ftp.download("/etc/extras/parameters.json", str(folder), burst):
            pass
        file = folder / "parameters.json"
        assert {p["name"] for p in json.loads(file.read_text())["parameters"]} == {p.name for p in TABLE}
        file.unlink()
    entries = await LogFilesAsync(vehicle.system).get_entries()
    assert entries


async def fly(connection: str, folder: Path) -> None:
    """Everything, one after the other, and down again."""
    async with mavsdk_vehicle(connection) as vehicle:
        await ready(vehicle)
        await vehicle.telemetry.set_rate_position_velocity_ned(20.0)
        await read_files(vehicle, folder)
        await steer_by_attitude(vehicle)
        await fly_an_orbit(vehicle)
        await follow(vehicle)
        await fly_by_sticks(vehicle)  # last: that they are gone would be a failsafe in the other modes
        await vehicle.action.land()
        await until(vehicle.telemetry.armed, lambda armed: not armed, "landed", LONG_PATIENCE)


def test_scripts_that_steer_by_attitude_sticks_orbit_and_target(tmp_path: Path) -> None:
    with flying_vehicle(tmp_path / "vehicle", parameters=HOLDS_WITHOUT_STICKS) as vehicle:
        asyncio.run(fly(vehicle.mavsdk, tmp_path))
    assert "armed" in vehicle.log.read_text()
