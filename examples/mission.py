"""Upload and fly three waypoints with MAVSDK: python examples/mission.py [udpin://…]"""

import asyncio
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mission import MissionAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.mission import MissionItem, MissionPlan

STEP = 5.0 / 111_180.0  # degrees; 5 m north, somewhat less east


async def main(connection: str) -> None:
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(connection)
        system = await mavsdk.first_autopilot(timeout_s=10)
        if system is None:
            sys.exit(f"no vehicle on {connection}: start one with `sitl fly hold`")
        action, mission, telemetry = ActionAsync(system), MissionAsync(system), TelemetryAsync(system)
        while not ((health := await telemetry.health()).is_armable and health.is_home_position_ok):
            await asyncio.sleep(0.2)
        home = await telemetry.home()
        plan = MissionPlan(
            [
                MissionItem(
                    latitude_deg=home.latitude_deg + north * STEP,
                    longitude_deg=home.longitude_deg + east * STEP,
                    relative_altitude_m=5.0,
                    speed_m_s=2.0,
                    is_fly_through=False,
                    acceptance_radius_m=0.5,  # for vehicle and load
                )
                for north, east in ((1, 0), (1, 1), (0, 1))
            ]
        )
        await mission.upload_mission(plan)
        await action.arm()
        await mission.start_mission()  # takes off by itself
        while not await mission.is_mission_finished():
            await asyncio.sleep(0.2)
        print("mission finished")
        await action.land()
        while await telemetry.armed():
            await asyncio.sleep(0.2)
        print("landed")


asyncio.run(main(sys.argv[1] if len(sys.argv) > 1 else "udpin://127.0.0.1:14540"))
