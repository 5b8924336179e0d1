"""Real plant, real controller, real clients: MAVSDK-Python, MAVProxy and pymavlink fly it over UDP."""

from __future__ import annotations

import asyncio
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mavlink

from sitl.testing import SimulatedVehicle, flying_vehicle
from tests.loopback import swing
from tests.loopback.clients import Vehicle, mavsdk_vehicle, until
from tests.loopback.flights import BRISK, WAITS_ARMED, mavproxy_flight, mavsdk_flight, take_off
from tests.loopback.pymav import PyMav
from tests.patience import LONG_PATIENCE, PATIENCE

EXAMPLES = Path(__file__).parents[3] / "examples"
LOCKSTEP = ("--clock", "lockstep", "--speed", "1")
LANDED = 0.15
"""m, height of an iris that stands on its legs, and some"""


def assert_landed(vehicle: SimulatedVehicle) -> swing.Flown:
    """The flight's log; at its end everything is on the ground, the vehicle not on its load.

    It lands 0.8 m beside the load, or 0.6 of the cable where a winch has left less of that; a receiver of
    decimetres takes some of it.
    """
    flown = swing.read(vehicle.state_log)
    assert flown.vehicle[-1, 2] < LANDED
    assert flown.load[-1, 2] < 0.06
    hung = np.flatnonzero(flown.load[:, 2] > 0.3)[-1]
    cable = float(np.linalg.norm(flown.vehicle[hung] - flown.load[hung]))
    beside = np.linalg.norm(flown.vehicle[-1, :2] - flown.load[-1, :2])
    assert beside > min(0.3, 0.5 * 0.6 * cable)
    return flown


def test_mavsdk_flies_everything(tmp_path: Path) -> None:
    with flying_vehicle(tmp_path) as vehicle:
        asyncio.run(mavsdk_flight(vehicle.mavsdk))
    flown = assert_landed(vehicle)
    assert flown.vehicle[:, 2].max() > 4.5


def test_mavproxy_flies_a_mission_and_lands(tmp_path: Path) -> None:
    with flying_vehicle(tmp_path / "vehicle", BRISK, WAITS_ARMED) as vehicle:
        mavproxy_flight(vehicle.mavproxy.replace("udpin", "udp"), tmp_path)
    assert_landed(vehicle)


async def _square(connection: str, side: float, height: float) -> None:
    from mavsdk.plugins.offboard import PositionNedYaw

    async with mavsdk_vehicle(connection) as vehicle:
        await take_off(vehicle, height)
        await vehicle.telemetry.set_rate_position_velocity_ned(20.0)
        corners = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side), (0.0, 0.0)]
        await vehicle.offboard.set_position_ned(PositionNedYaw(0.0, 0.0, -height, 90.0))
        await vehicle.offboard.start()
        for north, east in corners:
            await vehicle.offboard.set_position_ned(PositionNedYaw(north, east, -height, 90.0))
            await _arrive(vehicle, (north, east, -height))
        await vehicle.offboard.stop()
        await vehicle.action.land()
        await until(vehicle.telemetry.armed, lambda armed: not armed, "landed")


async def _arrive(vehicle: Vehicle, place: tuple[float, float, float]) -> None:
    def there(p: Any) -> bool:
        position, velocity = p.position, p.velocity
        away = math.dist((position.north_m, position.east_m, position.down_m), place)
        return away < 0.05 and math.hypot(velocity.north_m_s, velocity.east_m_s) < 0.05

    await until(vehicle.telemetry.position_velocity_ned, there, f"corner {place}")


def test_an_offboard_square_without_swing_or_overshoot(
    tmp_path: Path, record_property: pytest.RecordProperty
) -> None:
    # Overshoot is measured to centimetres: with a receiver that knows them.
    with flying_vehicle(tmp_path, (*LOCKSTEP, "--sensors", "rtk")) as vehicle:
        asyncio.run(_square(vehicle.mavsdk, 5.0, 5.0))
    flown = assert_landed(vehicle)
    flown = flown.between(0.0, float(flown.time[flown.vehicle[:, 2] > 4.9][-1]))
    corners = np.array([(0, 0), (0, 5), (5, 5), (5, 0), (0, 0)], dtype=float)
    begin = int(np.argmax(flown.vehicle[:, 2] > 4.9))
    passed = swing.overshoots(flown.vehicle[begin:, :2], corners)
    load_passed = swing.overshoots(flown.load[begin:, :2], corners)
    largest = float(swing.swing(flown.between(float(flown.time[begin]), 1e9)).max())
    record_property("vehicle_overshoot_m", passed.tolist())
    record_property("load_overshoot_m", load_passed.tolist())
    record_property("largest_swing_deg", largest)
    print(
        f"corner overshoot: vehicle {passed.max():.3f} m, load {load_passed.max():.3f} m; {largest:.1f} deg"
    )
    # A load of a twentieth of a corner's length out of place would show; the acceleration limit of
    # 2 m/s² alone swings it by atan(2 / 9.81) = 11.5 degrees.
    assert passed.max() < 0.25
    assert load_passed.max() < 0.25
    assert largest < 20.0


def test_refusals_say_why(tmp_path: Path) -> None:
    with flying_vehicle(tmp_path) as vehicle:
        client = PyMav(vehicle.mavproxy)
        client.wait_for("HEARTBEAT")
        for number, parameters, text in (
            (mavlink.MAV_CMD_DO_SET_MODE, (1.0, 1.0), "no position control"),
            (mavlink.MAV_CMD_MISSION_START, (), "upload one first"),
            (mavlink.MAV_CMD_DO_REPOSITION, (-1.0,), "take off first"),
        ):
            client.command(number, *parameters)
            client.wait_for_text(text)
        client.close()
    assert "armed" not in vehicle.log.read_text()


def test_new_weights_are_taken_in_flight_and_kept(tmp_path: Path) -> None:
    async def to_height(connection: str) -> None:
        async with mavsdk_vehicle(connection) as vehicle:
            await take_off(vehicle, 5.0)
            await vehicle.param.set_param_float("LQR_Q_LPOS", 4.0)

    with flying_vehicle(tmp_path, (*LOCKSTEP, "--feedback", "truth")) as vehicle:  # stillness is the law's
        client = PyMav(vehicle.mavproxy, system=244)
        asyncio.run(to_height(vehicle.mavsdk))
        client.wait_for_text("New weights in use")
        client.let_pass(2.0)
        client.texts().clear()
        keep, load_back = 1.0, 0.0
        assert client.command(mavlink.MAV_CMD_PREFLIGHT_STORAGE, keep) == 0
        assert json.loads(vehicle.log.with_name("parameters.json").read_text())["LQR_Q_LPOS"] == 4.0
        client.set_parameter("LQR_Q_LPOS", 1.0)
        client.wait_for_text("New weights in use")
        client.texts().clear()
        assert client.command(mavlink.MAV_CMD_PREFLIGHT_STORAGE, load_back) == 0
        client.wait_for_text("New weights in use")
        client.let_pass(2.0)
        client.close()
    flown = swing.read(vehicle.state_log)
    still = flown.between(float(flown.time[-1]) - 1.0, 1e9)
    assert np.ptp(still.load, axis=0).max() < 0.02
    assert still.load[-1, 2] > 2.5


def test_signed_links_ignore_the_unsigned(tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_text("0123456789abcdef" * 4)
    arguments = (*LOCKSTEP, "--signing-key", str(key))
    with flying_vehicle(tmp_path / "vehicle", arguments) as vehicle:
        link = mavutil.mavlink_connection(vehicle.mavproxy, source_system=245)
        link.wait_heartbeat(timeout=PATIENCE)  # pymavlink without a key takes what is signed
        unsigned = (1, 1, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1.0, *[math.nan] * 6)
        link.mav.command_long_send(*unsigned)
        assert link.recv_match(type="COMMAND_ACK", blocking=True, timeout=2) is None
        link.setup_signing(bytes.fromhex(key.read_text()), sign_outgoing=True)
        link.mav.command_long_send(*unsigned)
        ack = link.recv_match(type="COMMAND_ACK", blocking=True, timeout=PATIENCE)
        assert ack is not None
        assert ack.result == mavlink.MAV_RESULT_ACCEPTED
        link.close()


@pytest.mark.parametrize(
    ("script", "link"),
    [
        ("connect.py", "mavsdk"),
        ("mission.py", "mavsdk"),
        ("parameter_sweep.py", "mavsdk"),
        ("figure_eight.py", "mavproxy"),
    ],
)
def test_the_examples_fly(
    script: str, link: str, tmp_path: Path, record_property: pytest.RecordProperty
) -> None:
    # How near to its curve a load flies is measured to centimetres: with a receiver that knows them.
    sensors = ("--sensors", "rtk") if script == "figure_eight.py" else ()
    with flying_vehicle(tmp_path, (*LOCKSTEP, *sensors)) as vehicle:
        done = subprocess.run(
            [sys.executable, str(EXAMPLES / script), getattr(vehicle, link)],
            capture_output=True,
            text=True,
            timeout=LONG_PATIENCE,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr + vehicle.log.read_text()[-2000:]
        assert "landed" in done.stdout
    flown = assert_landed(vehicle)
    if script == "figure_eight.py":
        assert_figure_eight(flown)
    elif script == "mission.py":
        report_mission(flown, record_property)


def report_mission(flown: swing.Flown, record_property: pytest.RecordProperty) -> None:
    """Three way-points, 5 m apart: within half a metre of each, which is their acceptance radius."""
    corners = np.array([(0, 5), (5, 5), (5, 0)], dtype=float)
    up = flown.time[flown.vehicle[:, 2] > 4.5]
    flown = flown.between(float(up[0]), float(up[-1]))
    begin = int(np.argmin(np.linalg.norm(flown.vehicle[:, :2] - corners[0], axis=1)))
    passed = {
        body: float(swing.overshoots(positions[begin:, :2], corners).max())
        for body, positions in (("vehicle", flown.vehicle), ("load", flown.load))
    }
    largest = float(swing.swing(flown).max())
    for body, overshoot in passed.items():
        record_property(f"{body}_overshoot_m", overshoot)
    record_property("largest_swing_deg", largest)
    print(f"mission: {passed} m past a way-point at most; swing {largest:.1f} deg at most")
    assert max(passed.values()) < 0.5
    assert largest < 20.0


def assert_figure_eight(flown: swing.Flown) -> None:
    """The load was on the curve at last, all over it, though joining it took some seconds."""
    phase = np.linspace(0.0, 2.0 * math.pi, 2000)
    curve = np.stack([1.5 * np.sin(2.0 * phase), 3.0 * np.sin(phase), np.full_like(phase, 3.0)], axis=1)
    up = flown.time[np.abs(flown.load[:, 2] - 3.0) < 0.05]
    load = flown.between(float(up[0]) + 3.0, float(up[-1]) - 4.0).load[::25]
    away = np.linalg.norm(load[:, None] - curve, axis=2).min(axis=1)
    rms = float(np.sqrt(np.mean(away**2)))
    print(f"figure eight: the load {rms:.3f} m rms from the curve, {away.max():.3f} m at most")
    # On `rtk` a load on a short cable keeps within 4 cm rms in each of the two directions across the curve.
    assert rms < math.sqrt(2.0) * 0.04
    assert away.max() < 3.0 * math.sqrt(2.0) * 0.04
    assert load[:, 1].min() < -2.9


def test_the_fixture_example_runs_as_a_plugin(tmp_path: Path) -> None:
    done = subprocess.run(
        [
            *(sys.executable, "-m", "pytest", "-c", os.devnull),
            *("-p", "sitl.pytest_plugin", "-p", "no:cacheprovider"),
            str(EXAMPLES / "test_with_a_vehicle.py"),
        ],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert "1 passed" in done.stdout, done.stdout + done.stderr
