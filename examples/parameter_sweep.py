"""How fast is 5 m at each speed limit? A sweep in one flight: python examples/parameter_sweep.py [udpin://…]"""

import asyncio
import math
import sys
import time

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync

METRES_PER_DEGREE = 111_180.0


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
        await action.arm()
        await action.takeoff()
        while (await telemetry.flight_mode()).name != "HOLD":
            await asyncio.sleep(0.2)
        start = await telemetry.position()
        for leg, speed in enumerate((1.0, 2.0, 3.0)):
            await param.set_param_float("MPC_XY_CRUISE", speed)
            latitude = start.latitude_deg + (5.0 if leg % 2 == 0 else 0.0) / METRES_PER_DEGREE
            longitude, height = start.longitude_deg, start.absolute_altitude_m
            began = time.monotonic()
            await action.goto_location(latitude, longitude, height, math.nan)
            while abs((await telemetry.position()).latitude_deg - latitude) * METRES_PER_DEGREE > 0.3:
                await asyncio.sleep(0.05)
            print(f"MPC_XY_CRUISE {speed:g} m/s: 5 m in {time.monotonic() - began:.1f} s")
        await action.return_to_launch()
        while await telemetry.armed():
            await asyncio.sleep(0.2)
        print("landed")


asyncio.run(main(sys.argv[1] if len(sys.argv) > 1 else "udpin://127.0.0.1:14540"))
