"""Flights of real clients through everything a ground station does; an AssertionError says what fails.

`python -m tests.loopback.flights mavsdk udpin://127.0.0.1:14540` or `… mavproxy udp:127.0.0.1:14550 FOLDER`
flies one against whatever vehicle stands there, disarmed on the ground.
"""

from __future__ import annotations

import asyncio
import math
import sys
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from tests.loopback.clients import MavProxy, Vehicle, mavsdk_vehicle, until
from tests.patience import LONG_PATIENCE

METRES_PER_DEGREE = 111_180.0
BRISK = ("--clock", "lockstep", "--speed", "4")
"""As fast as the machine can, up to four times, where no client's clock has to be the vehicle's"""
WAITS_ARMED = {"COM_DISARM_PRFLT": 120.0}
"""Its ten seconds of waiting for a take-off are soon over then."""


async def refused(action: Callable[[], Awaitable[Any]], words: str) -> None:
    """An action that has to be refused with an error that contains some words."""
    with pytest.raises(Exception, match=words):  # each plugin has an error class of its own
        await action()


async def ready(vehicle: Vehicle) -> None:
    """Wait until the vehicle says that it can be armed, and where it is (MAVSDK has NaN until then)."""
    await until(
        vehicle.telemetry.health,
        lambda h: h.is_armable and h.is_global_position_ok and h.is_home_position_ok,
        "armable",
    )
    await until(vehicle.telemetry.position, lambda p: math.isfinite(p.latitude_deg), "position")


async def version(vehicle: Vehicle) -> Any | None:
    """What MAVSDK knows of the vehicle's version; None before AUTOPILOT_VERSION is there."""
    from mavsdk.plugins.info import InfoError

    try:
        return await vehicle.info.get_version()
    except InfoError:
        return None


async def information_and_parameters(vehicle: Vehicle) -> None:
    """Version, every parameter, set and refused."""
    await until(lambda: version(vehicle), bool, "version")
    every = await vehicle.param.get_all_params()
    assert {"COM_RC_IN_MODE", "SYS_AUTOSTART"} <= {p.name for p in every.int_params}
    assert "MIS_TAKEOFF_ALT" in {p.name for p in every.float_params}
    await vehicle.param.set_param_float("MIS_TAKEOFF_ALT", 4.5)
    assert await vehicle.param.get_param_float("MIS_TAKEOFF_ALT") == 4.5
    assert await vehicle.param.get_param_int("COM_RC_IN_MODE") == 1
    await refused(lambda: vehicle.param.set_param_float("MIS_TAKEOFF_ALT", 1e9), "OUT_OF_RANGE")
    await refused(lambda: vehicle.param.set_param_float("NO_SUCH", 1.0), "DOES_NOT_EXIST")
    await refused(lambda: vehicle.param.set_param_float("GF_ACTION", 1.0), "TYPE_MISMATCH")


async def take_off(vehicle: Vehicle, altitude: float) -> None:
    """Arm, take off, wait for Hold in the air."""
    await ready(vehicle)
    await vehicle.action.set_takeoff_altitude(altitude)
    await vehicle.action.arm()
    await vehicle.action.takeoff()
    await until(vehicle.telemetry.flight_mode, lambda m: m.name == "TAKEOFF", "take-off mode")
    await until(
        vehicle.telemetry.flight_mode, lambda m: m.name == "HOLD", "hold after take-off", LONG_PATIENCE
    )
    position = await vehicle.telemetry.position()
    assert abs(position.relative_altitude_m - altitude) < 0.5, position


async def go_to(vehicle: Vehicle, north: float, east: float, tolerance: float = 0.5) -> None:
    """Go so many metres away and arrive."""
    here = await vehicle.telemetry.position()
    latitude = here.latitude_deg + north / METRES_PER_DEGREE
    longitude = here.longitude_deg + east / METRES_PER_DEGREE / math.cos(math.radians(here.latitude_deg))
    await vehicle.action.goto_location(latitude, longitude, here.absolute_altitude_m, 0.0)

    def away(p: Any) -> float:
        d_east = (p.longitude_deg - longitude) * math.cos(math.radians(latitude))
        return math.hypot(p.latitude_deg - latitude, d_east) * METRES_PER_DEGREE

    await until(vehicle.telemetry.position, lambda p: away(p) < tolerance, "arrival")


async def three_waypoints(vehicle: Vehicle) -> None:
    """Upload, download, fly, follow the progress, clear."""
    from mavsdk.plugins.mission import MissionItem, MissionPlan

    here = await vehicle.telemetry.position()
    step = 5.0 / METRES_PER_DEGREE
    plan = MissionPlan(
        [
            MissionItem(
                latitude_deg=here.latitude_deg + north * step,
                longitude_deg=here.longitude_deg + east * step,
                relative_altitude_m=5.0,
                speed_m_s=2.0,
                is_fly_through=False,
                acceptance_radius_m=1.0,
            )
            for north, east in ((1, 0), (1, 1), (0, 1))
        ]
    )
    await vehicle.mission.upload_mission(plan)
    back = await vehicle.mission.download_mission()
    assert [round(item.latitude_deg, 6) for item in back.mission_items] == [
        round(item.latitude_deg, 6) for item in plan.mission_items
    ]
    await vehicle.mission.start_mission()
    await until(vehicle.telemetry.flight_mode, lambda m: m.name == "MISSION", "mission mode")
    await until(vehicle.mission.is_mission_finished, bool, "mission finished", LONG_PATIENCE)
    await vehicle.mission.clear_mission()
    await refused(vehicle.mission.start_mission, "DENIED")


async def offboard(vehicle: Vehicle) -> None:
    """Position, then velocity, then back to Hold."""
    from mavsdk.plugins.offboard import PositionNedYaw, VelocityNedYaw

    await vehicle.offboard.set_position_ned(PositionNedYaw(2.0, 1.0, -5.0, 0.0))
    await vehicle.offboard.start()
    await until(
        vehicle.telemetry.position_velocity_ned,
        lambda p: math.dist((p.position.north_m, p.position.east_m, p.position.down_m), (2, 1, -5)) < 0.5,
        "offboard position",
    )
    await vehicle.offboard.set_velocity_ned(VelocityNedYaw(1.0, 0.0, 0.0, 0.0))
    await until(
        vehicle.telemetry.position_velocity_ned,
        lambda p: p.velocity.north_m_s > 0.7 and p.position.north_m > 3.0,
        "offboard velocity",
    )
    await vehicle.offboard.stop()
    await until(vehicle.telemetry.flight_mode, lambda m: m.name == "HOLD", "hold after offboard")


async def mavsdk_flight(connection: str) -> None:
    """Everything, one after the other."""
    async with mavsdk_vehicle(connection) as vehicle:
        await information_and_parameters(vehicle)
        await refused(lambda: vehicle.action.goto_location(47.39, 8.54, 500.0, 0.0), "DENIED")
        await take_off(vehicle, 5.0)
        await vehicle.telemetry.set_rate_position_velocity_ned(20.0)
        await go_to(vehicle, 4.0, 2.0)
        await three_waypoints(vehicle)
        await offboard(vehicle)
        await refused(vehicle.action.disarm, "DENIED")
        await vehicle.action.return_to_launch()
        await until(vehicle.telemetry.armed, lambda armed: not armed, "disarmed after return", LONG_PATIENCE)


WAYPOINTS = """QGC WPL 110
0	1	3	16	0	1	0	0	47.397782	8.545594	5	1
1	0	3	16	0	1	0	0	47.397782	8.545654	6	1
2	0	3	201	3	0	0	0	47.398	8.546	0	1
3	0	2	2000	0	1	0	0	0	0	0	1
4	0	2	112	1	0	0	0	0	0	0	1
5	0	2	211	1	2	0	0	0	0	0	1
6	0	3	16	0	1	0	0	47.397742	8.545654	5	1
7	0	2	42600	1	1	0.3	0.5	0	0	0	1
8	0	2	42600	1	6	0	0	0	0	0	1
"""
"""Way-points, a region of interest, a camera that is not there, a condition, gripper and winch"""
FENCE = """QGC WPL 110
0	0	3	5001	3	0	0	0	47.3970	8.5440	0	1
1	0	3	5001	3	0	0	0	47.3970	8.5470	0	1
2	0	3	5001	3	0	0	0	47.3990	8.5456	0	1
3	0	3	5004	5	0	0	0	47.3981	8.5456	0	1
"""
RALLY = """QGC WPL 110
0	0	3	5100	0	0	0	0	47.39780	8.54570	20	1
"""


def mavproxy_flight(master: str, folder: Path) -> None:
    """Parameters, fence, rally, logs, arming, take-off, mission, landing, as a person types them."""
    for name, text in (("plan", WAYPOINTS), ("fence", FENCE), ("rally", RALLY)):
        (folder / f"{name}.txt").write_text(text)
    proxy = MavProxy(master, folder)
    try:
        at = proxy.wait_for("parameters (ftp)")
        proxy.say("ftp list /")
        at = proxy.wait_for("D @PARAM", after=at)
        proxy.say("param set MIS_TAKEOFF_ALT 4.5")
        time.sleep(1.0)
        proxy.say("param show MIS_TAKEOFF_ALT")
        at = proxy.wait_for("4.5", after=at)
        proxy.say("param set GF_ACTION 77")
        at = proxy.wait_for("GF_ACTION = 77: allowed", after=at)
        for kind, first in (("fence", "5001 3 47.397"), ("rally", "5100 3 47.397")):
            proxy.say(f"{kind} load {kind}.txt")
            at = proxy.wait_for(f"TYPE_{kind.upper()}: ACCEPTED", after=at)
            proxy.say(f"{kind} list")
            at = proxy.wait_for(first, after=at)
        proxy.say("log list")
        at = proxy.wait_for("numLogs", after=at)
        proxy.say("wp load plan.txt")
        at = proxy.wait_for("TYPE_MISSION: ACCEPTED", after=at)
        proxy.say("wp list")
        at = proxy.wait_for("47.3977420000", after=at)
        proxy.say("long COMPONENT_ARM_DISARM 7")
        at = proxy.wait_for("Arm or disarm denied", after=at)
        proxy.say("arm throttle")
        at = proxy.wait_for("ARMED", after=at)
        proxy.say("long NAV_TAKEOFF 0 0 0 nan nan nan nan")
        at = proxy.wait_for("Mode TAKEOFF", after=at)
        at = proxy.wait_for("Mode LOITER", LONG_PATIENCE, after=at)
        proxy.say("long DO_SET_MODE 1 4 4")
        at = proxy.wait_for("Mission finished", LONG_PATIENCE, after=at)
        proxy.say("wp set 9")
        at = proxy.wait_for("Mission item 9 does not exist; there are 9", after=at)
        proxy.say("wp set 1")
        at = proxy.wait_for("waypoint 1", after=at)
        proxy.say("wp clear")
        at = proxy.wait_for("TYPE_MISSION: ACCEPTED", after=at)
        proxy.say("wp list")
        at = proxy.wait_for("Requesting 0 waypoints", after=at)
        proxy.say("long MISSION_START")
        at = proxy.wait_for("upload one first", after=at)
        proxy.say("disarm")
        at = proxy.wait_for("in flight; land first", after=at)
        proxy.say("long DO_SET_MODE 1 4 6")
        at = proxy.wait_for("Mode LAND", after=at)
        proxy.wait_for("DISARMED", LONG_PATIENCE, after=at)
    finally:
        proxy.stop()


if __name__ == "__main__":
    if sys.argv[1] == "mavsdk":
        asyncio.run(mavsdk_flight(sys.argv[2]))
    else:
        mavproxy_flight(sys.argv[2], Path(sys.argv[3]))
    print("flown")
