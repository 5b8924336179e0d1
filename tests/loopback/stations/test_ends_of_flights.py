"""Kill and termination with MAVSDK: the plant's rotors stop, and what comes after is refused or not."""

from __future__ import annotations

import asyncio
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from pymavlink.dialects.v20 import common as mavlink

from sitl.recording.recording import read_recording
from sitl.testing import flying_vehicle
from sitl_bridge.event_log import read_events
from tests.loopback import swing
from tests.loopback.clients import Texts, Vehicle, mavsdk_vehicle, until
from tests.loopback.flights import BRISK, WAITS_ARMED, ready, refused, take_off
from tests.loopback.pymav import PyMav


async def kill_just_above_the_ground(vehicle: Vehicle, texts: Texts) -> None:
    await ready(vehicle)
    await vehicle.param.set_param_float(
        "MPC_TKO_SPEED", 0.3
    )  # still low when it is seen to be off the ground
    ground = (await vehicle.telemetry.position()).relative_altitude_m
    await vehicle.action.arm()
    await vehicle.action.takeoff()
    await until(vehicle.telemetry.position, lambda p: p.relative_altitude_m > ground + 0.3, "off the ground")
    await vehicle.action.kill()
    await texts.wait_for("Disarmed by force: rotors stopped")
    await until(vehicle.telemetry.armed, lambda armed: not armed, "disarmed")
    await until(vehicle.telemetry.landed_state, lambda s: s.name == "ON_GROUND", "fallen")
    await vehicle.param.set_param_float("MPC_TKO_SPEED", 1.0)


async def terminate_in_the_air(vehicle: Vehicle, texts: Texts) -> None:
    await take_off(vehicle, 5.0)  # nothing is left of the kill
    await vehicle.action.terminate()
    await texts.wait_for("Flight terminated: rotors stopped")
    await refused(vehicle.action.hold, "DENIED")
    await refused(vehicle.action.takeoff, "DENIED")
    await texts.wait_for("terminated; disarm first")
    await refused(vehicle.action.arm, "DENIED|REJECTED")
    assert await vehicle.telemetry.armed()


async def two_ends(connection: str, watcher: PyMav) -> None:
    async with mavsdk_vehicle(connection) as vehicle, Texts(vehicle) as texts:
        await kill_just_above_the_ground(vehicle, texts)
        await terminate_in_the_air(vehicle, texts)
        await asyncio.to_thread(
            watcher.wait,
            lambda m: (
                m.get_type() == "HEARTBEAT"
                and m.get_srcSystem() == 1
                and m.system_status == mavlink.MAV_STATE_FLIGHT_TERMINATION
            ),
            "termination in HEARTBEAT",
        )
        await until(vehicle.telemetry.position, lambda p: p.relative_altitude_m < 1.0, "fallen")
        await vehicle.action.disarm()
        await until(vehicle.telemetry.armed, lambda armed: not armed, "disarmed")
        await asyncio.to_thread(watcher.let_pass, 1.0)


def test_a_kill_near_the_ground_and_a_termination_in_the_air(tmp_path: Path) -> None:
    with flying_vehicle(tmp_path, BRISK, WAITS_ARMED) as vehicle:
        watcher = PyMav(vehicle.mavproxy, system=244)
        asyncio.run(two_ends(vehicle.mavsdk, watcher))
        watcher.close()
    diary = read_events(tmp_path)
    said = [event.text for event in diary if event.kind == "statustext"]
    assert said.index("Disarmed by force: rotors stopped") < said.index("Flight terminated: rotors stopped")
    assert {"Takeoff", "disarmed"} <= {event.text for event in diary if event.kind == "mode"}
    recording = read_recording(tmp_path)
    assert recording.summary["vehicle"] == "iris"
    assert np.isnan(recording.reference).all()
    flown = swing.read(vehicle.state_log)
    assert flown.vehicle[:, 2].max() > 4.5
    assert flown.vehicle[-1, 2] < 0.5
    rotors = pq.read_table(vehicle.state_log, columns=[f"rotor_{n}_rad_s" for n in (1, 2, 3, 4)])
    assert max(column.to_numpy()[-1] for column in rotors.columns) < 1.0
