"""Change the LQR's weights in flight and see what it does: python examples/parameter_sweep.py [udpin://…]"""

import asyncio
import math
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.telemetry import LandedState

METRES_PER_DEGREE = 111_180.0
LEG = 5.0  # m, north and back
LEG_TIME = 10.0  # s, to get there and come to rest


async def heard(telemetry: TelemetryAsync, words: str) -> None:
    async for status in telemetry.subscribe_status_text():
        if words in status.text:
            return


async def main(connection: str) -> None:
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(connection)
        system = await mavsdk.first_autopilot(timeout_s=10)
        if system is None:
            sys.exit(f"no vehicle on {connection}: start one with `sitl fly hold`")
        action, param, telemetry = ActionAsync(system), ParamAsync(system), TelemetryAsync(system)
        while not (await telemetry.health()).is_armable:
            await asyncio.sleep(0.2)
        await telemetry.set_rate_position_velocity_ned(20.0)
        await action.arm()
        await action.takeoff()
        while await telemetry.landed_state() != LandedState.IN_AIR:
            await asyncio.sleep(0.2)
        home, here = await telemetry.home(), await telemetry.position()
        for leg, weight in enumerate((0.1, 0.5, 2.0, 10.0)):
            new = asyncio.create_task(heard(telemetry, "New weights in use"))
            await asyncio.sleep(0.1)  # the subscription is there
            await param.set_param_float("LQR_Q_INT", weight)
            await new  # the gains have been designed again, in flight
            goal = LEG if leg % 2 == 0 else 0.0
            latitude = home.latitude_deg + goal / METRES_PER_DEGREE
            await action.goto_location(latitude, home.longitude_deg, here.absolute_altitude_m, math.nan)
            norths = []
            for _ in range(round(LEG_TIME / 0.1)):
                norths.append((await telemetry.position_velocity_ned()).position.north_m)
                await asyncio.sleep(0.1)
            passed = max(norths) - goal if goal else goal - min(norths)
            print(f"LQR_Q_INT {weight:g}: at {norths[-1]:.2f} m north, passed by {100 * passed:.1f} cm")
        await action.return_to_launch()
        while await telemetry.armed():
            await asyncio.sleep(0.2)
        print("landed")


asyncio.run(main(sys.argv[1] if len(sys.argv) > 1 else "udpin://127.0.0.1:14540"))
