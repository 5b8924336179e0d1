"""What PX4 streams unasked, and scripts wait for without asking."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.telemetry.message_rates import ONBOARD_RATES, WITHOUT_DATA
from tests.controller.ground.in_flight import ACCEPTED, DENIED, flying
from tests.controller.ground.kinematic import ZURICH
from tests.controller.ground.rig import NAN, Client, Rig

ONBOARD = 1


def counted(client: Client, number: int) -> int:
    return sum(1 for raw in client.raw if raw[7] | raw[8] << 8 == number)


def test_companions_get_by_their_link_what_px4_sends_them_unasked() -> None:
    rig = Rig()
    companion, station = rig.client(14540, link=ONBOARD), rig.client(14550)
    rig.run(5.0)
    for number, rate in ONBOARD_RATES.items():
        assert counted(companion, number) == pytest.approx(5.0 * rate, abs=1.5), number
        assert counted(station, number) == 0, number
    assert companion.command(511, mavlink.MAVLINK_MSG_ID_ODOMETRY, 0).result == ACCEPTED  # its default
    companion.clear()
    rig.run(2.0)
    assert counted(companion, mavlink.MAVLINK_MSG_ID_ODOMETRY) == pytest.approx(20, abs=2)


def test_the_target_is_in_degrees_too() -> None:
    rig, client = flying()
    client.command(192, -1, 1, 0, NAN, ZURICH[0] + 20.0 / 111_200.0, ZURICH[1], ZURICH[2] + 8.0)
    rig.run(30.0)
    client.clear()
    rig.run(2.0)
    target = client.got("POSITION_TARGET_GLOBAL_INT")[-1]
    assert target.lat_int / 1e7 == pytest.approx(ZURICH[0] + 20.0 / 111_200.0, abs=1e-5)
    assert target.lon_int / 1e7 == pytest.approx(ZURICH[1], abs=1e-6)
    assert target.alt == pytest.approx(ZURICH[2] + 8.0, abs=0.1)
    assert target.type_mask == client.got("POSITION_TARGET_LOCAL_NED")[-1].type_mask


def test_the_attitude_that_is_asked_for_is_told() -> None:
    rig, client = flying()
    turn = (math.cos(0.25), 0.0, 0.0, math.sin(0.25))

    def steer() -> None:
        client.send(mavlink.MAVLink_set_attitude_target_message(0, 1, 1, 0b111, turn, 0, 0, 0, 0.5))

    rig.before_step = steer
    rig.run(0.1)
    assert client.command(176, 1, 6).result == ACCEPTED
    client.clear()
    rig.run(1.0)
    told = client.got("ATTITUDE_TARGET")[-1]
    assert told.q == pytest.approx(turn, abs=1e-6)
    assert told.thrust == pytest.approx(0.5)
    assert told.type_mask == 0b111


def test_the_rotors_are_in_servo_output_and_actuator_status() -> None:
    rig, client = flying()
    rig.view.rotors = (0.25, 0.5, 0.75, 1.0, 0.0, 0.1)
    rig.frozen = True
    rig.run(1.1)
    servo = client.got("SERVO_OUTPUT_RAW")[-1]
    pulses = [getattr(servo, f"servo{n}_raw") for n in range(1, 9)]
    assert pulses == [1250, 1500, 1750, 2000, 1000, 1100, 0, 0]
    assert client.command(512, mavlink.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS).result == ACCEPTED
    status = client.got("ACTUATOR_OUTPUT_STATUS")[-1]
    assert status.active == 6
    assert list(status.actuator[:6]) == pytest.approx(rig.view.rotors)


@pytest.mark.parametrize("number", sorted(WITHOUT_DATA))
def test_a_rate_is_taken_for_what_a_px4_without_that_sensor_takes(number: int) -> None:
    """MAVSDK's set_rate_distance_sensor and the like end a script if they are denied."""
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    assert client.command(511, number, 1e5).result == ACCEPTED
    client.clear()
    rig.run(0.5)
    assert counted(client, number) == 0
    assert client.command(512, number).result == DENIED


def test_sensor_data_that_a_busy_machine_delays_do_not_keep_it_from_arming() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    rig.view.hil_age = 0.9 * rig.station.parameters["COM_HIL_LOSS_T"]
    assert client.command(400, 1).result == ACCEPTED
    client.command(400, 0)
    rig.view.hil_age = 1.1 * rig.station.parameters["COM_HIL_LOSS_T"]
    assert client.command(400, 1).result != ACCEPTED
    assert "no sensor data for" in client.texts()[-1]
