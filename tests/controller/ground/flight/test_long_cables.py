"""Take-off and a point 20 m away on cables up to 30 m: nothing turns over."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink

from sitl_bridge.frames import rotate
from tests.controller.ground.flown import Flown

LARGEST_TILT = math.radians(35.0)


@pytest.mark.parametrize("length", [3.0, 10.0, 20.0, 30.0])
def test_a_point_twenty_metres_away_is_reached_upright(length: float) -> None:
    flight = Flown(f"cable.rest_length={length}")
    client = flight.client()
    worst = [0.0]

    def watch() -> None:
        attitude = tuple(flight.simulation.world.state[6:10].tolist())
        worst[0] = max(worst[0], math.acos(min(1.0, rotate(attitude, (0.0, 0.0, 1.0))[2])))  # type: ignore[arg-type]

    flight.every_tick = watch
    flight.take_off(client, timeout=120.0)
    flight.run(5.0)
    east, north, up = flight.simulation.world.state[13:16].tolist()
    target = (east + 20.0, north)
    point = flight.profile.origin.geodetic((*target, up + flight.profile.hover_length))
    place = (round(point.latitude * 1e7), round(point.longitude * 1e7), point.altitude)
    parameters = (-1.0, 1.0, 0.0, math.nan)
    acknowledged = client.command_int(mavlink.MAV_CMD_DO_REPOSITION, parameters, *place)
    assert acknowledged.result == 0, client.texts()
    flight.run(40.0)
    assert worst[0] < LARGEST_TILT
    assert np.linalg.norm(flight.simulation.world.state[13:15] - target) < 0.3
