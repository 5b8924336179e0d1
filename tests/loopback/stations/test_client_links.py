"""The links of ground control with real processes: several clients, loss, old peers, stalls, restarts."""

from __future__ import annotations

import asyncio
import math
import os
import signal
import socket
import statistics
import time
from collections.abc import Awaitable, Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v10 import common as mavlink1
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.parameters.table import TABLE
from sitl.flights.free_ports import free_ports
from sitl.testing import SimulatedVehicle, flying_vehicle
from tests.loopback import swing
from tests.loopback.by_hand import ByHand
from tests.loopback.clients import MavProxy, Vehicle, mavsdk_vehicle, until
from tests.loopback.conftest import Process
from tests.loopback.flights import ready, refused, take_off
from tests.loopback.lossy import lossy_relay
from tests.loopback.pymav import HOLD, LAND, OFFBOARD, PyMav
from tests.patience import LONG_PATIENCE, PATIENCE


def port_of(connection: str) -> int:
    return int(connection.rsplit(":", 1)[1])


def spacing_ms(client: PyMav, kind: str, seconds: float = 4.0) -> float:
    """Between two messages of a type, on the vehicle's clock."""
    heard = [m for m in client.listen(seconds) if m.get_type() == kind and m.get_srcSystem() == 1]
    return statistics.median(b.time_boot_ms - a.time_boot_ms for a, b in pairwise(heard))


def test_three_clients_at_once_each_with_its_own_rates(tmp_path: Path) -> None:
    async def with_mavsdk(vehicle: SimulatedVehicle, proxy: MavProxy, third: PyMav) -> None:
        async with mavsdk_vehicle(vehicle.mavsdk) as sdk:
            await ready(sdk)
            assert third.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 32, 20_000) == 0
            await sdk.telemetry.set_rate_position(2.0)
            every = await sdk.param.get_all_params()
            assert len(every.int_params) + len(every.float_params) == len(TABLE)
            proxy.say("param fetch")
            proxy.wait_for(f"Received {len(TABLE)} parameters")
            fast, usual = spacing_ms(third, "LOCAL_POSITION_NED"), spacing_ms(third, "ATTITUDE")
            assert usual / fast == pytest.approx(5.0, rel=0.3)  # 10 Hz and 50 Hz, for this one alone
            battery = await anext(sdk.telemetry.subscribe_battery())
            assert 10.0 < battery.voltage_v < 13.0  # the plant's own 3S pack
            # One arms, another sees it, the third disarms.
            proxy.say("arm throttle")
            await until(sdk.telemetry.armed, bool, "armed")
            assert third.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == 0
            await until(sdk.telemetry.armed, lambda armed: not armed, "disarmed")

    with flying_vehicle(tmp_path / "vehicle") as vehicle:
        proxy = MavProxy(vehicle.mavproxy.replace("udpin", "udp"), tmp_path)
        third = PyMav(vehicle.ground, system=200)
        try:
            third.wait_for("HEARTBEAT")
            asyncio.run(with_mavsdk(vehicle, proxy, third))
            # The load is a system of its own, on the same link.
            assert third.wait_for("HEARTBEAT", 101).type == mavlink.MAV_TYPE_AIRSHIP
            load = third.wait_for("GLOBAL_POSITION_INT", 101)
            own = third.wait_for("GLOBAL_POSITION_INT", 1)
            assert load.get_srcComponent() == 35
            east = math.radians(1e-7) * (load.lon - own.lon) * 6.37e6 * math.cos(math.radians(own.lat * 1e-7))
            assert east == pytest.approx(1.0, abs=0.05)  # where `iris` lays it
        finally:
            third.close()
            proxy.stop()


def test_with_a_tenth_lost_each_way_everything_still_arrives(tmp_path: Path) -> None:
    with flying_vehicle(tmp_path) as vehicle:
        with lossy_relay(port_of(vehicle.ground), 0.1, seed=1) as port:
            client = PyMav(f"udpout:127.0.0.1:{port}")
            assert all_parameters(client) == {p.name for p in TABLE}
            client.close()
        with lossy_relay(port_of(vehicle.companion), 0.1, seed=2) as port:
            asyncio.run(mission_up_and_down(f"udpout://127.0.0.1:{port}"))


def all_parameters(client: PyMav) -> set[str]:
    """The names of the list, what it lacks asked for again until it is complete."""
    client.wait_for("HEARTBEAT")
    client.link.mav.param_request_list_send(1, 1)
    found: dict[int, str] = {}
    lost = 0
    deadline = time.monotonic() + PATIENCE
    while len(found) < len(TABLE):
        assert time.monotonic() < deadline, f"{len(found)} of {len(TABLE)}"
        for message in client.listen(0.5):
            if message.get_type() == "PARAM_VALUE" and message.param_index < len(TABLE):
                found[message.param_index] = message.param_id
        for index in set(range(len(TABLE))) - set(found):
            lost += 1
            client.link.mav.param_request_read_send(1, 1, b"", index)
    assert lost > 0, "nothing was lost: no test"
    return set(found.values())


async def at_last(exchange: Callable[[], Awaitable[Any]]) -> Any:
    """What an exchange of MAVSDK's brings, begun again when it gives up.

    It gives up after a few losses of one message, an upload at the first loss of its last acknowledgement.
    """
    from mavsdk.exceptions import MavsdkError

    deadline = time.monotonic() + PATIENCE
    while True:
        try:
            return await exchange()
        except MavsdkError as error:
            gave_up = error.result.name in ("TIMEOUT", "BUSY")
            if not gave_up or time.monotonic() > deadline:
                raise
            await asyncio.sleep(0.5)  # it is busy for a while with what it gave up


async def mission_up_and_down(connection: str) -> None:
    from mavsdk.plugins.mission import MissionItem, MissionPlan

    async with mavsdk_vehicle(connection) as vehicle:
        await ready(vehicle)
        home = await vehicle.telemetry.position()
        items = [
            MissionItem(
                latitude_deg=home.latitude_deg + north * 1e-5,
                longitude_deg=home.longitude_deg,
                relative_altitude_m=5.0,
                speed_m_s=2.0,
                is_fly_through=True,
                acceptance_radius_m=1.0,
            )
            for north in range(10)
        ]
        await at_last(lambda: vehicle.mission.upload_mission(MissionPlan(items)))
        back = (await at_last(vehicle.mission.download_mission)).mission_items
        assert len(back) == len(items)
        for sent, got in zip(items, back, strict=True):
            assert got.latitude_deg == pytest.approx(sent.latitude_deg, abs=1e-7)
        await at_last(vehicle.action.arm)
        await at_last(vehicle.action.disarm)


def test_a_peer_that_speaks_mavlink_1_is_answered_in_mavlink_1(tmp_path: Path) -> None:
    with flying_vehicle(tmp_path) as vehicle, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as old:
        old.settimeout(0.5)
        writer = mavlink1.MAVLink(None, srcSystem=250, srcComponent=190)
        reader = mavlink1.MAVLink(None)
        heard: dict[str, Any] = {}
        deadline = time.monotonic() + PATIENCE
        while not {"HEARTBEAT", "ATTITUDE", "PARAM_VALUE", "COMMAND_ACK"} <= set(heard):
            assert time.monotonic() < deadline, sorted(heard)
            for message in (
                mavlink1.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3),
                mavlink1.MAVLink_param_request_read_message(1, 1, b"MPC_XY_CRUISE", -1),
                mavlink1.MAVLink_command_long_message(1, 1, 512, 0, 148, *[0.0] * 6),
            ):
                old.sendto(message.pack(writer), ("127.0.0.1", port_of(vehicle.ground)))
            for _ in range(50):
                try:
                    datagram = old.recv(65535)
                except TimeoutError:
                    break
                assert datagram[0] == 0xFE, "not MAVLink 1"
                for message in reader.parse_buffer(datagram) or []:
                    heard[message.get_type()] = message
        assert heard["PARAM_VALUE"].param_value == pytest.approx(3.0)


def test_a_failure_asked_for_with_mavsdk_happens_in_the_plant(tmp_path: Path) -> None:
    said: list[str] = []

    async def listen(vehicle: Vehicle) -> None:
        async for status in vehicle.telemetry.subscribe_status_text():
            said.append(status.text)

    async def lose_a_rotor(connection: str) -> None:
        from mavsdk.asyncio.plugins.failure import FailureAsync
        from mavsdk.plugins.failure import FailureType, FailureUnit

        async with mavsdk_vehicle(connection) as vehicle:
            await ready(vehicle)
            listening = asyncio.create_task(listen(vehicle))
            # The plugin reads the parameter once, when it is made.
            await vehicle.param.set_param_int("SYS_FAILURE_EN", 1)
            failure = FailureAsync(vehicle.system)
            unknown = (FailureUnit.SENSOR_VIO, FailureType.OFF, 0)
            await refused(lambda: failure.inject(*unknown), "UNSUPPORTED|DENIED")
            await take_off(vehicle, 5.0)
            await failure.inject(FailureUnit.SYSTEM_MOTOR, FailureType.OFF, 1)
            await until(vehicle.telemetry.flight_mode, lambda m: m.name != "HOLD", "flight failed")
            await until(vehicle.telemetry.position, lambda p: p.relative_altitude_m < 0.5, "fallen")
            listening.cancel()

    with flying_vehicle(tmp_path) as vehicle:
        asyncio.run(lose_a_rotor(vehicle.mavsdk))
    assert any("has no such unit" in text for text in said)
    assert any("Flight failed" in text for text in said)
    flown = swing.read(vehicle.state_log)
    assert flown.vehicle[:, 2].max() > 4.5
    assert flown.vehicle[-1, 2] < 1.0


def test_what_px4_gets_wrong_over_the_wire(tmp_path: Path) -> None:
    """Each refusal acknowledged, and explained; a good frame found behind junk with a false start byte."""
    with flying_vehicle(tmp_path) as vehicle:
        client = PyMav(vehicle.mavproxy)
        client.ready()
        for number, parameters, words in (
            (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (7.0,), "use 1 or 0"),
            (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (math.nan,), "use 1 or 0"),
            (mavlink.MAV_CMD_DO_SET_MODE, (1.0, 99.0), "does not exist"),
        ):
            assert client.command(number, *parameters) == mavlink.MAV_RESULT_DENIED
            client.wait_for_text(words)
            client.texts().clear()
        for name, value, words in (
            ("MPC_XY_CRUISE", math.nan, "not a finite number"),
            ("NONE", 1.0, "no such"),
        ):
            client.link.mav.param_set_send(1, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)
            assert client.wait_for("PARAM_ERROR").param_id == name
            client.wait_for_text(words)
        ask = mavlink.MAVLink_command_long_message(1, 1, 512, 0, 148, *[0.0] * 6)
        client.link.write(b"\xfd\xff\x00\x00" + ask.pack(client.link.mav))
        client.wait_for("AUTOPILOT_VERSION")
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        assert not client.wait_for("HEARTBEAT").base_mode & armed
        client.close()


RTK = ("--sensors", "rtk")
"""With a receiver that knows the height again after a restart, where a consumer's is metres off."""


def test_a_stall_and_a_restart_of_the_controller_in_flight(start: Callable[..., Process]) -> None:
    """Taken off in QGroundControl's order, under offboard control: neither is the end of the flight."""
    vehicle = ByHand(start, RTK)
    client = PyMav(f"udpin:127.0.0.1:{vehicle.gcs_peer}")
    try:
        client.ready()
        client.set_parameter("MIS_TAKEOFF_ALT", 3.0)
        assert client.command(mavlink.MAV_CMD_NAV_TAKEOFF) == 0  # before arming
        assert client.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0
        client.wait_until_in_air()

        def send() -> None:
            position_only = 0xFF8
            client.link.mav.set_position_target_local_ned_send(
                0, 1, 1, 1, position_only, 0.0, 1.0, -15.0, *[0.0] * 8
            )

        def arrived(message: Any) -> bool:
            send()
            return (
                message.get_type() == "LOCAL_POSITION_NED"
                and message.get_srcSystem() == 1
                and abs(message.z + 15.0) < 0.3
                and abs(message.vz) < 0.1
            )

        client.let_pass(0.3, send)
        assert client.command(mavlink.MAV_CMD_DO_SET_MODE, 1, *OFFBOARD) == 0
        client.wait(arrived, "15 m up", LONG_PATIENCE)
        os.kill(vehicle.controller.popen.pid, signal.SIGSTOP)
        stalled_until = time.monotonic() + 4.0  # the world waits: nothing is heard
        while time.monotonic() < stalled_until:
            send()
            client.poll()
        os.kill(vehicle.controller.popen.pid, signal.SIGCONT)
        client.let_pass(2.0, send)
        client.wait_for_mode(OFFBOARD, send)
        assert not [text for text in client.texts() if text.startswith("No ")]

        vehicle.controller.close()
        vehicle.start_controller()
        client.wait_for_text("Started in flight")
        client.wait_for_mode(HOLD)
        # It falls while the estimate is aligned anew, with the rotors stopped, is caught some metres lower
        # (2.5 to 5.7 in twelve flights), and goes back up to near where it was found.
        client.let_pass(10.0)
        held = client.wait_for("LOCAL_POSITION_NED")
        assert -18.0 < held.z < -7.0
        assert abs(held.vz) < 0.5
        assert client.command(mavlink.MAV_CMD_DO_SET_MODE, 1, *LAND) == 0
        client.wait_until_disarmed()
    finally:
        client.close()


def test_open_links_are_warned_of(start: Callable[..., Process]) -> None:
    hil, gcs, gcs_peer, onboard, onboard_peer = free_ports(5)
    controller = start(
        *("controller", "--scenario", "hold", "--hil", f"udpin:127.0.0.1:{hil}", "--expose"),
        *("--gcs", f"{gcs}:{gcs_peer}", "--onboard", f"{onboard}:{onboard_peer}"),
    )
    controller.wait_for("warning: --expose opens the ground-control links to ANYBODY")


def test_no_other_design_under_ground_control(start: Callable[..., Process]) -> None:
    for command in (("fly", "hold"), ("controller", "--scenario", "hold")):
        code, _, said = start(*command, "--design", "paper").finish()
        assert code == 2
        assert "LQR_*" in said
