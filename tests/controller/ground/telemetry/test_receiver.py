"""What ground control is shown of the plant's sensors, on truth and on the estimate."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.pilot.guided.gps_display import SILENCE, Receiver
from sitl_bridge.mavlink.hil import HIL_GPS
from sitl_bridge.plant.sensors.instruments import LOST, OFF, WORKS
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.ground.flown import Flown
from tests.controller.ground.rig import Client
from tests.estimator.guided import GuidedFlight


def record(**fields: int) -> Any:
    made = HIL_GPS.record()[0][0]
    for name, value in fields.items():
        made[name] = value
    return made


def test_fixes_and_their_end() -> None:
    wire = record()
    receiver = Receiver(wire, rate=10.0)
    assert receiver.look(1.0).fix_type == 0
    for name, value in {
        "time_usec": 900_000, "lat": 475_000_000, "lon": 85_000_000, "alt": 500_000, "eph": 70, "epv": 120,
        "vn": 200, "ve": 100, "vd": -300, "fix_type": 3, "satellites_visible": 14,
    }.items():  # fmt: skip
        wire[name] = value
    seen = receiver.look(1.1)
    assert (seen.fix_type, seen.satellites) == (3, 14)
    assert (seen.horizontal_accuracy, seen.vertical_accuracy) == (0.7, 1.2)
    assert seen.velocity == (1.0, 2.0, 3.0)
    assert receiver.look(1.1 + 0.9 * SILENCE) == seen
    lost = receiver.look(1.1 + 1.1 * SILENCE)
    assert (lost.fix_type, lost.position) == (1, seen.position)
    assert math.isnan(lost.horizontal_accuracy)
    wire["time_usec"] = 2_400_000
    assert receiver.look(2.5).fix_type == 3
    assert receiver.look(0.1).fix_type == 1  # the plant has restarted
    wire["time_usec"], wire["fix_type"], wire["satellites_visible"] = 2_500_000, 1, 3
    lost = receiver.look(2.6)
    assert (lost.fix_type, lost.satellites, lost.position) == (1, 3, seen.position)


def test_a_slow_receiver_is_waited_for() -> None:
    receiver = Receiver(record(time_usec=1, fix_type=3), rate=0.5)
    receiver.look(1.0)
    assert receiver.look(3.5).fix_type == 3
    assert receiver.look(5.5).fix_type == 1


def ask_for(client: Client, *numbers: int) -> None:
    for number in numbers:
        assert client.command(511, number, 20_000).result == 0


@pytest.mark.parametrize("failure", [OFF, LOST])
def test_on_truth_the_receivers_place_is_shown_and_its_loss(failure: int) -> None:
    flight = Flown("sensors.gps.horizontal_wander=30.0", "sensors.gps.delay=0.2")
    client = flight.client()
    flight.run(0.5)
    ask_for(client, mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, mavlink.MAVLINK_MSG_ID_HIGHRES_IMU)
    flight.run(0.5)
    gps, place = client.got("GPS_RAW_INT")[-1], client.got("GLOBAL_POSITION_INT")[-1]
    assert (gps.fix_type, gps.satellites_visible) == (3, flight.vehicle.sensors.gps.satellites)
    assert math.hypot(gps.lat - place.lat, gps.lon - place.lon) > 100  # 1 m: its own place
    imu = client.got("HIGHRES_IMU")[-1]
    assert imu.zacc == pytest.approx(-9.81, abs=0.3)
    assert imu.zacc != -9.81
    flight.simulation.world.set_sensor("gps", failure)
    flight.run(2.0)
    assert client.got("GPS_RAW_INT")[-1].fix_type in (0, 1)
    flight.simulation.world.set_sensor("gps", WORKS)
    flight.run(1.0)
    assert client.got("GPS_RAW_INT")[-1].fix_type == 3


def test_on_the_estimate_too() -> None:
    flight = GuidedFlight(load_vehicle("iris"))
    flight.wait(3.0)
    view = flight.machine.view
    assert view is not None
    assert view.gps.fix_type == 3
    assert view.gps.position is not None
    assert view.acceleration[2] == pytest.approx(9.81, abs=0.5)
    flight.simulation.world.set_sensor("gps", OFF)
    flight.wait(1.5)
    assert view.gps.fix_type == 1
