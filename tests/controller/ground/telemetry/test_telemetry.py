"""Telemetry: the numbers on the wire against the view, and states beyond all bounds."""

from __future__ import annotations

import dataclasses
import math

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.telemetry.message_rates import STREAMABLE
from controller.ground.telemetry.messages import CAPABILITIES
from controller.ground.telemetry.state_messages import cell_voltages
from controller.ground.telemetry.vehicle_state import Gps, profile_of
from sitl_bridge.frames import Geodetic, quaternion_from_euler
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.ground.kinematic import ZURICH, grounded_view
from tests.controller.ground.rig import Client, Rig


def seen(**changes: object) -> tuple[Rig, Client]:
    """Every streamable message of a view."""
    rig = Rig()
    client = rig.client()
    rig.frozen = True
    rig.run(0.1)  # home is where the vehicle stood
    rig.view = dataclasses.replace(rig.view, **changes)
    rig.station.machine.armed = True
    client.clear()
    for number in STREAMABLE:
        client.send(mavlink.MAVLink_command_long_message(1, 1, 512, 0, number, *(0,) * 6))
    rig.station.machine.view = rig.view
    for address, datagram in rig.station.to_send(rig.now):
        if address == client.address:
            client.take([datagram])
    client.clear()
    for number in STREAMABLE:
        client.send(mavlink.MAVLink_command_long_message(1, 1, 512, 0, number, *(0,) * 6))
    for address, datagram in rig.station.to_send(rig.now):
        if address == client.address:
            client.take([datagram])
    return rig, client


def test_positions_velocities_and_angles() -> None:
    _, client = seen(
        time=12.5,
        position=(10.0, 20.0, 5.0),
        velocity=(1.0, 2.0, 3.0),
        attitude=quaternion_from_euler((0.1, 0.2, 0.3)),
        body_rates=(0.4, 0.5, 0.6),
        acceleration=(1.0, 2.0, 9.0),
        gps=Gps(3, 14, 0.7, 1.2, Geodetic(47.5, 8.5, 500.0), (1.1, 2.0, 3.0)),
    )
    heading = math.pi / 2 - 0.3
    local = client.got("LOCAL_POSITION_NED")[0]
    assert (local.x, local.y, local.z) == pytest.approx((20, 10, -5))
    assert (local.vx, local.vy, local.vz) == pytest.approx((2, 1, -3))
    assert local.time_boot_ms == 12500
    attitude = client.got("ATTITUDE")[0]
    assert (attitude.roll, attitude.pitch, attitude.yaw) == pytest.approx((0.1, -0.2, heading), abs=1e-6)
    assert (attitude.rollspeed, attitude.pitchspeed, attitude.yawspeed) == pytest.approx((0.4, -0.5, -0.6))
    q = client.got("ATTITUDE_QUATERNION")[0]
    assert (q.q1, q.q2, q.q3, q.q4) == pytest.approx(quaternion_from_euler((0.1, -0.2, heading)), abs=1e-6)
    place = client.got("GLOBAL_POSITION_INT")[0]
    assert place.lat / 1e7 == pytest.approx(ZURICH[0] + 20 / 111_180, abs=1e-6)
    assert place.lon / 1e7 == pytest.approx(ZURICH[1] + 10 / 75_500, abs=1e-6)
    assert (place.alt, place.relative_alt) == (493000, 4900)
    assert (place.vx, place.vy, place.vz) == (200, 100, -300)
    assert place.hdg == pytest.approx(math.degrees(heading) * 100, abs=1)
    hud = client.got("VFR_HUD")[0]
    assert (hud.groundspeed, hud.climb, hud.alt) == pytest.approx((math.sqrt(5), 3, 493))
    altitude = client.got("ALTITUDE")[0]
    assert (altitude.altitude_amsl, altitude.altitude_local, altitude.altitude_relative) == pytest.approx(
        (493, 5, 4.9)
    )
    gps = client.got("GPS_RAW_INT")[0]
    assert (gps.fix_type, gps.vel, gps.satellites_visible) == (3, 228, 14)
    assert (gps.lat, gps.lon, gps.alt) == (
        475_000_000,
        85_000_000,
        500_000,
    )  # not the estimate's
    assert (gps.eph, gps.epv, gps.h_acc, gps.v_acc) == (70, 120, 700, 1200)
    assert gps.cog == pytest.approx(math.degrees(math.atan2(1.1, 2)) * 100, abs=1)
    imu = client.got("HIGHRES_IMU")[0]
    assert (imu.xacc, imu.yacc, imu.zacc) == pytest.approx((1, -2, -9))
    home = client.got("HOME_POSITION")[0]
    assert (home.altitude, home.z) == (488100, pytest.approx(-0.1))


def test_without_a_fix_nothing_is_made_up() -> None:
    _, client = seen(position=(10.0, 20.0, 5.0), velocity=(1.0, 2.0, 3.0), gps=Gps())
    gps = client.got("GPS_RAW_INT")[0]
    assert (gps.fix_type, gps.satellites_visible) == (0, 255)
    assert (gps.lat, gps.lon, gps.alt) == (0, 0, 0)
    assert (gps.eph, gps.epv, gps.vel, gps.cog) == (0xFFFF,) * 4


def test_battery_and_status() -> None:
    _, client = seen(battery_voltage=15.2, battery_current=12.34, battery_remaining=0.5)
    status = client.got("SYS_STATUS")[0]
    assert (status.voltage_battery, status.current_battery, status.battery_remaining) == (15200, 1234, 50)
    battery = client.got("BATTERY_STATUS")[0]
    assert battery.voltages == [3800] * 4 + [0xFFFF] * 6
    assert (battery.current_battery, battery.battery_remaining) == (1234, 50)
    _, client = seen(battery_voltage=math.nan, battery_current=math.nan, battery_remaining=math.nan)
    status = client.got("SYS_STATUS")[0]
    assert (status.voltage_battery, status.current_battery, status.battery_remaining) == (0xFFFF, -1, -1)


@pytest.mark.parametrize(
    ("cells", "volts", "voltages", "further"),
    [
        (3, 11.4, [3800] * 3 + [0xFFFF] * 7, [0] * 4),
        (10, 38.0, [3800] * 10, [0] * 4),
        (12, 45.6, [3800] * 10, [3800] * 2 + [0] * 2),
        (14, 53.2, [3800] * 10, [3800] * 4),
        (20, 76.0, [65534, 10466] + [0xFFFF] * 8, [0] * 4),  # no room for 20 cells: the pack's voltage
        (20, 50.0, [50000] + [0xFFFF] * 9, [0] * 4),
        (12, math.nan, [0xFFFF] * 10, [0] * 4),
    ],
)
def test_voltages_of_cells(cells: int, volts: float, voltages: list[int], further: list[int]) -> None:
    assert cell_voltages(volts, cells) == (voltages, further)


@pytest.mark.parametrize(("name", "cells"), [("iris", 3), ("heavy", 12), ("paper", 4)])
def test_the_battery_has_the_vehicles_cells(name: str, cells: int) -> None:
    rig = Rig(profile_of(load_vehicle(name)))
    client = rig.client()
    parameters = rig.station.parameters
    assert parameters.integer("BAT1_N_CELLS") == cells
    rig.view.battery_voltage = 3.7 * cells
    rig.run(3.0)
    battery = client.got("BATTERY_STATUS")[-1]
    shown = [*battery.voltages, *battery.voltages_ext]
    assert [volts for volts in shown if volts not in (0, 0xFFFF)] == [3700] * cells
    assert parameters.set("BAT1_N_CELLS", 6) == ""
    parameters.reset()
    assert parameters.integer("BAT1_N_CELLS") == cells


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, 1e300, -1e9])
def test_a_state_beyond_all_bounds_is_no_crash(number: float) -> None:
    three = (number, number, number)
    rig, client = seen(
        position=three,
        velocity=three,
        attitude=(number,) * 4,
        body_rates=three,
        load_position=three,
        load_velocity=three,
        battery_voltage=number,
        battery_current=number,
        battery_remaining=number,
        throttle=number,
        acceleration=three,
        gps=Gps(3, 10, number, number, None, three),
    )
    assert client.got("HEARTBEAT")
    rig.run(1.0)


def test_who_the_vehicle_is() -> None:
    rig = Rig()
    client = rig.client()
    client.command(512, 148)
    version = client.got("AUTOPILOT_VERSION")[0]
    assert version.capabilities == CAPABILITIES
    assert version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    assert version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_FTP
    assert version.uid != 0


def test_landed_states() -> None:
    rig = Rig()
    client = rig.client()
    states = []

    client.command(511, 245, 20000)
    rig.fly(client)
    client.command(21)
    rig.run_until(lambda: not rig.station.armed)
    rig.run(0.1)
    for message in client.got("EXTENDED_SYS_STATE"):
        if not states or states[-1] != message.landed_state:
            states.append(message.landed_state)
    assert states == [1, 3, 2, 4, 1]


def test_the_target_is_reported() -> None:
    rig = Rig()
    client = rig.client()
    rig.fly(client)
    rig.run(1.1)
    target = client.got("POSITION_TARGET_LOCAL_NED")[-1]
    assert target.z == pytest.approx(-2.6, abs=0.1)  # the vehicle's, not the load's
    assert target.type_mask & 0b111 == 0
    assert target.type_mask & 0b111111000 == 0b111111000


def test_a_grounded_view_is_what_the_other_tests_think() -> None:
    view = grounded_view()
    assert view.in_reach
    assert not dataclasses.replace(view, position=(math.nan, 0.0, 0.0)).in_reach
