"""What a viewer is told beside the poses: the scenario's time, the cable, wind and battery. No I/O."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import common

from sitl_bridge.frames import enu_to_ned
from sitl_bridge.plant.wire.slow_frames import battery_status

if TYPE_CHECKING:
    from sitl_bridge.plant.simulation import Simulation

SCENARIO_TIME, TENSION = "scenario", "tension"
"""Names of NAMED_VALUE_FLOAT: s since the scenario began; N, NaN where the cable joins nothing."""
CHAIN = "chain"
"""Name of DEBUG_FLOAT_ARRAY: north, east, down (m) of each node of a chain, from the top."""
ARRAY_SIZE = 58
"""Numbers in a DEBUG_FLOAT_ARRAY: enough for the nodes of the longest chain."""


def moving(simulation: Simulation) -> list[Any]:
    """Time of the scenario, once it has begun; tension; a chain's nodes."""
    time_usec, world = simulation.time_usec, simulation.world
    time_ms = (time_usec // 1000) & 0xFFFFFFFF
    tension = world.cable_tension() if world.cable_holds else math.nan
    messages = [_named(time_ms, TENSION, tension)]
    if simulation.started:
        messages.append(_named(time_ms, SCENARIO_TIME, simulation.scenario_time))
    if world.vehicle.cable.is_chain:
        numbers = [part for x, y, z in world.chain_nodes().tolist() for part in enu_to_ned((x, y, z))]
        numbers += [0.0] * (ARRAY_SIZE - len(numbers))
        messages.append(common.MAVLink_debug_float_array_message(time_usec, CHAIN.encode(), 0, numbers))
    return messages


def weather(simulation: Simulation) -> list[Any]:
    """WIND_COV, and BATTERY_STATUS of a vehicle that has a battery."""
    world, power, battery = simulation.world, simulation.power, simulation.world.vehicle.battery
    east, north, up = world.wind().tolist()
    wind = enu_to_ned((east, north, up))
    nan = math.nan
    height = float(world.state[2])
    messages: list[Any] = [
        common.MAVLink_wind_cov_message(simulation.time_usec, *wind, nan, nan, height, nan, nan)
    ]
    if power is not None and battery is not None:
        messages.append(battery_status(battery, power))
    return messages


def _named(time_ms: int, name: str, value: float) -> Any:
    return common.MAVLink_named_value_float_message(time_ms, name.encode(), value)
