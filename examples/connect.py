"""Connect with MAVSDK, take off with the load, come back: python examples/connect.py [udpin://…]"""

import asyncio
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.telemetry import LandedState


async def main(connection: str) -> None:
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(connection)
        system = await mavsdk.first_autopilot(timeout_s=10)
        if system is None:
            sys.exit(f"no vehicle on {connection}: start one with `sitl fly hold`")
        action, telemetry = ActionAsync(system), TelemetryAsync(system)
        while not (await telemetry.health()).is_armable:
            await asyncio.sleep(0.2)
        await action.arm()
        await action.takeoff()
        while await telemetry.landed_state() != LandedState.IN_AIR:
            await asyncio.sleep(0.2)
        height = (await telemetry.position()).relative_altitude_m
        print(f"flying at {height:.2f} m, the load below")
        await action.return_to_launch()  # sets the load down first
        while await telemetry.armed():
            await asyncio.sleep(0.2)
        print("landed")


asyncio.run(main(sys.argv[1] if len(sys.argv) > 1 else "udpin://127.0.0.1:14540"))
