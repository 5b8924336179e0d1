"""Deliver the load and come back, step by step or as a mission: python examples/delivery.py [--mission] [udpin://…]"""

import asyncio
import math
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.gripper import GripperAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.asyncio.plugins.winch import WinchAsync
from mavsdk.plugins.mission_raw import MissionItem

NORTH = 12.0 / 111_180.0  # degrees, to where the load is wanted
HEIGHT = 5.0  # m, of the vehicle above home
WAYPOINT, RETURN, DO_WINCH, DELIVER = 16, 20, 42600, 4
RELATIVE, MISSION = 6, 2  # frames: degrees and metres above home; no place at all


async def until(read, holds):
    """Read until something holds; returns what was read then."""
    while not holds(value := await read()):
        await asyncio.sleep(0.2)
    return value


async def step_by_step(action, telemetry, gripper, winch, home) -> None:
    """Fly there, lower the load to the ground, let it go, reel in."""
    await action.set_takeoff_altitude(HEIGHT)
    await action.arm()
    await action.takeoff()
    latitude = home.latitude_deg + NORTH
    await action.goto_location(latitude, home.longitude_deg, home.absolute_altitude_m + HEIGHT, 0.0)
    await until(telemetry.position, lambda p: abs(p.latitude_deg - latitude) * 111_180.0 < 0.3)
    await asyncio.sleep(3.0)  # the load comes to rest
    length = (await until(winch.status, lambda s: s.tension_kg > 0.1)).line_length_m
    await winch.relative_length_control(1, HEIGHT - length + 0.5, 0.4)  # slack at the end
    await until(winch.status, lambda s: s.tension_kg < 0.02)
    print("the load is on the ground")
    await gripper.release(1)
    await asyncio.sleep(1.0)
    way = length - (await winch.status()).line_length_m
    await winch.relative_length_control(1, way, 0.5)
    await until(winch.status, lambda s: s.line_length_m < length + 0.1)
    print("delivered")
    await action.return_to_launch()


async def as_a_mission(action, mission, home) -> None:
    """The same as a plan of four items; the winch's own sequence does what happens at the place."""
    north, east = round((home.latitude_deg + NORTH) * 1e7), round(home.longitude_deg * 1e7)
    at_home = round(home.latitude_deg * 1e7)
    items = [
        MissionItem(0, RELATIVE, WAYPOINT, 1, 1, 3, 1, 0, math.nan, north, east, HEIGHT, 0),
        MissionItem(1, MISSION, DO_WINCH, 0, 1, 1, DELIVER, math.nan, math.nan, 0, 0, 0, 0),
        MissionItem(2, RELATIVE, WAYPOINT, 0, 1, 0, 1, 0, math.nan, at_home, east, HEIGHT, 0),
        MissionItem(3, MISSION, RETURN, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0),
    ]
    await mission.upload_mission(items)
    await action.arm()
    await mission.start_mission()
    await until(mission.mission_progress, lambda p: p.current == 2)
    print("delivered")


async def main(connection: str, by_mission: bool) -> None:
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(connection)
        system = await mavsdk.first_autopilot(timeout_s=10)
        if system is None:
            sys.exit(f"no vehicle on {connection}: start one with `sitl fly hold`")
        action, telemetry = ActionAsync(system), TelemetryAsync(system)
        gripper, winch, mission = GripperAsync(system), WinchAsync(system), MissionRawAsync(system)
        while not ((health := await telemetry.health()).is_armable and health.is_home_position_ok):
            await asyncio.sleep(0.2)
        home = await telemetry.home()
        if by_mission:
            await as_a_mission(action, mission, home)
        else:
            await step_by_step(action, telemetry, gripper, winch, home)
        while await telemetry.armed():
            await asyncio.sleep(0.2)
        print("landed")


arguments = [a for a in sys.argv[1:] if a != "--mission"]
asyncio.run(main(arguments[0] if arguments else "udpin://127.0.0.1:14540", "--mission" in sys.argv))
