"""What a vehicle answers, asked over UDP in ways that MAVSDK and MAVProxy do not have."""

from __future__ import annotations

import asyncio
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mavlink

from sitl.testing import SimulatedVehicle, flying_vehicle
from tests.loopback.clients import Vehicle, mavsdk_vehicle, send_command, until
from tests.loopback.pymav import PyMav

NO_SUCH_COMMAND = 31999
AVAILABLE_MODES = 435
WRONG_TYPE = 7
"""MAV_PARAM_ERROR_TYPE_MISMATCH of the current dialect"""


def heard_in(client: PyMav, seconds: float, kind: str) -> list[Any]:
    """The vehicle's messages of a type in so much of its time."""
    begin = len(client.heard)
    client.let_pass(seconds)
    return [m for m in client.heard[begin:] if m.get_type() == kind and m.get_srcSystem() == 1]


def pings_and_time(client: PyMav) -> None:
    client.link.mav.ping_send(123456, 7, 0, 0)
    ping = client.wait_for("PING")
    assert (ping.time_usec, ping.seq, ping.target_system, ping.target_component) == (123456, 7, 244, 190)
    client.link.mav.ping_send(123456, 8, 9, 9)  # for somebody else
    times = []
    for stamp in (11, 12):
        client.link.mav.timesync_send(0, stamp)
        answer = client.wait_for("TIMESYNC")
        assert answer.ts1 == stamp
        times.append(answer.tc1)
    assert 0 < times[0] < times[1]
    client.link.mav.timesync_send(1, 13)  # an answer, and an answer is not answered
    assert not [m for m in heard_in(client, 1.0, "TIMESYNC") if m.ts1 == 13]
    assert not [m for m in client.heard if m.get_type() == "PING" and m.seq == 8]


def messages_and_rates(client: PyMav, command: Callable[..., int]) -> None:
    """By COMMAND_LONG or COMMAND_INT, which mean the same: a message once, then a stream of it, then none."""
    odometry = mavlink.MAVLINK_MSG_ID_ODOMETRY
    assert not heard_in(client, 0.5, "ODOMETRY")
    assert command(mavlink.MAV_CMD_REQUEST_MESSAGE, odometry) == mavlink.MAV_RESULT_ACCEPTED
    assert len([m for m in client.heard if m.get_type() == "ODOMETRY"]) == 1
    assert command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, odometry, 20_000) == mavlink.MAV_RESULT_ACCEPTED
    assert command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, odometry) == mavlink.MAV_RESULT_ACCEPTED
    told = [m for m in client.heard if m.get_type() == "MESSAGE_INTERVAL"][-1]
    assert (told.message_id, told.interval_us) == (odometry, 20_000)
    for _ in range(5):
        client.wait_for("ODOMETRY")
    assert command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, odometry, -1) == mavlink.MAV_RESULT_ACCEPTED
    assert not heard_in(client, 0.5, "ODOMETRY")
    assert command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 9, 20_000) == mavlink.MAV_RESULT_DENIED
    client.wait_for_text("Message 9 cannot be streamed")
    assert command(NO_SUCH_COMMAND) == mavlink.MAV_RESULT_UNSUPPORTED
    client.wait_for_text(f"Command {NO_SUCH_COMMAND} (unknown) is not supported")
    client.let_pass(0.5)
    assert len([m for m in client.heard if m.get_type() == "COMMAND_ACK"]) == 6  # one each
    client.texts().clear()
    client.heard.clear()


def parameters_that_cannot_be(client: PyMav) -> None:
    real, whole = mavlink.MAV_PARAM_TYPE_REAL32, mavlink.MAV_PARAM_TYPE_INT32
    missing, range_ = mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST, mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
    seventy_seven = struct.unpack("<f", struct.pack("<i", 77))[0]
    mav = client.link.mav
    for send, name, error, words in (
        (lambda: mav.param_request_read_send(1, 1, b"NONE", -1), "NONE", missing, "NONE: no such parameter"),
        (lambda: mav.param_request_read_send(1, 1, b"", 9999), "", missing, "9999: no such index"),
        (lambda: mav.param_set_send(1, 1, b"GF_ACTION", 1.0, real), "GF_ACTION", WRONG_TYPE, "is INT32"),
        (lambda: mav.param_set_send(1, 1, b"GF_ACTION", seventy_seven, whole), "GF_ACTION", range_, "= 77"),
        (lambda: mav.param_set_send(1, 1, b"LQR_Q_ATT", -1.0, real), "LQR_Q_ATT", range_, "allowed: 0.001"),
    ):
        send()
        said = client.wait_for("PARAM_ERROR")
        assert (said.param_id, said.error) == (name, error)
        assert (said.target_system, said.target_component) == (244, 190)
        client.wait_for_text(words)


async def modes_there_are(vehicle: Vehicle) -> None:
    """AVAILABLE_MODES, all of them asked for at once, which pymavlink's dialect does not know."""
    from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync

    direct = MavlinkDirectAsync(vehicle.system)
    modes: dict[int, dict[str, Any]] = {}

    async def collect() -> None:
        async for message in direct.subscribe_message("AVAILABLE_MODES"):
            mode = json.loads(message.fields_json)
            modes[mode["mode_index"]] = mode

    collecting = asyncio.create_task(collect())
    await asyncio.sleep(0)  # subscribed
    asked = await send_command(vehicle, mavlink.MAV_CMD_REQUEST_MESSAGE, AVAILABLE_MODES)
    assert asked == mavlink.MAV_RESULT_ACCEPTED

    async def count() -> tuple[int, int]:
        return len(modes), modes[1]["number_modes"] if 1 in modes else -1

    await until(count, lambda seen: seen[0] == seen[1], "all available modes")
    collecting.cancel()
    by_name = {mode["mode_name"]: mode["custom_mode"] for mode in modes.values()}
    for main, sub in ((4, 2), (4, 3), (4, 4), (4, 5), (4, 6), (6, 0)):
        assert main << 16 | sub << 24 in by_name.values(), by_name


async def rates_of_mavsdk(connection: str) -> None:
    async with mavsdk_vehicle(connection) as vehicle:
        # Streams that are off unless asked for.
        await vehicle.telemetry.set_rate_odometry(20.0)
        await vehicle.telemetry.set_rate_imu(20.0)
        await anext(vehicle.telemetry.subscribe_odometry())
        imu = await anext(vehicle.telemetry.subscribe_imu())
        assert imu.acceleration_frd.down_m_s2 == pytest.approx(-9.81, abs=1.0)
        await vehicle.telemetry.set_rate_distance_sensor(5.0)  # taken, as PX4 does without the sensor
        await modes_there_are(vehicle)


def test_what_is_asked_over_udp_is_answered(tmp_path: Path) -> None:
    def ask(vehicle: SimulatedVehicle) -> None:
        client = PyMav(vehicle.mavproxy, system=244)
        try:
            client.wait_for("LOCAL_POSITION_NED")
            pings_and_time(client)
            messages_and_rates(client, client.command)
            messages_and_rates(client, client.command_int)
            parameters_that_cannot_be(client)
        finally:
            client.close()

    with flying_vehicle(tmp_path) as vehicle:
        ask(vehicle)
        asyncio.run(rates_of_mavsdk(vehicle.mavsdk))
