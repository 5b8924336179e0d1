"""A flight's folder made by hand: a load on a circle, a tumbling vehicle, sensors with known readings."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pymavlink.dialects.v20 import common

from controller.law.terms import TERM_COLUMNS
from controller.pilot.terms_log import FILE_NAME as TERMS_NAME
from sitl.recording.recording import SUMMARY_NAME, write_reference, write_vehicle
from sitl_bridge.frames import quaternion_from_euler
from sitl_bridge.mavlink.framing import Packer
from sitl_bridge.mavlink.tlog import FILE_NAME as TLOG_NAME
from sitl_bridge.mavlink.tlog import TlogWriter
from sitl_bridge.plant.log.rows import columns
from sitl_bridge.plant.log.state_log import FILE_NAME as STATES_NAME
from sitl_bridge.vehicle.files import load_vehicle

RATE_HZ = 250.0
ROWS = 501
BEGIN_USEC = 1_000_000
"""`time_usec` of the tick with which the scenario begins."""


def leave_flight(folder: Path, rows: int = ROWS) -> None:
    """Write everything that a flight leaves, two seconds of it; no estimate.

    Column n of the law's terms is n.
    """
    vehicle = load_vehicle("iris", [])
    times = np.arange(rows) / RATE_HZ
    names = columns(len(vehicle.rotors))
    table = {name: np.zeros(rows) for name in names}
    table["time_s"] = times
    table["load_x_m"], table["load_y_m"], table["load_z_m"] = np.sin(times), np.cos(times), 2.0 + 0.1 * times
    table["load_vx_m_s"], table["load_vy_m_s"] = np.cos(times), -np.sin(times)
    table["vehicle_z_m"] = table["load_z_m"] + 1.5
    euler = np.column_stack((0.2 * np.sin(3 * times), 0.3 * np.cos(2 * times), times))
    for row, (roll, pitch, yaw) in enumerate(euler.tolist()):
        for part, value in zip("wxyz", quaternion_from_euler((roll, pitch, yaw)), strict=True):
            table[f"attitude_q{part}"][row] = value
    table["body_rate_p_rad_s"] = np.cos(times)
    table["cable_length_m"] = np.full(rows, 1.5)
    table["cable_tension_N"] = np.where(times > 1.0, 0.0, 3.0)
    for index, rotor in enumerate(vehicle.rotors):
        table[f"rotor_{index + 1}_rad_s"] = np.full(rows, 0.1 * (index + 1) * rotor.max_speed)
    folder.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table(table), folder / STATES_NAME)
    write_vehicle(folder, vehicle)
    write_reference(folder, times, np.column_stack((np.sin(times), np.cos(times), np.full(rows, 2.0))))
    summary = {
        "scenario": "circle",
        "vehicle": "iris",
        "seed": 3,
        "settled": True,
        "first_command_unix_s": 1.7e9,
    }
    (folder / SUMMARY_NAME).write_text(json.dumps(summary), encoding="utf-8")
    terms = {name: np.full(rows, float(number)) for number, name in enumerate(TERM_COLUMNS)}
    pq.write_table(pa.table({"time_s": times, **terms}), folder / TERMS_NAME)
    _leave_tlog(folder / TLOG_NAME, rows)


def _leave_tlog(file: Path, rows: int) -> None:
    """HIL_SENSOR at each tick, a fix every tenth, the answers; ticks before the first armed answer, too."""
    plant, autopilot = Packer(1, 1), Packer(1, 1)
    log = TlogWriter(file)
    for tick in range(-5, rows - 1):
        time_usec = BEGIN_USEC + round(tick * 1e6 / RATE_HZ)
        armed = common.MAV_MODE_FLAG_SAFETY_ARMED if tick >= 0 else 0
        sensor = common.MAVLink_hil_sensor_message(
            time_usec, 0.5, 0.25, -9.75, 0.125, 0, 0, 0, 0, 0, 900, 0, 488, 20, 0x1FFF, 0
        )
        datagram = plant.pack(sensor)
        if tick % 10 == 0:
            fix = common.MAVLink_hil_gps_message(
                time_usec, 3, 473977420 + tick, 85455940, 488_000, 100, 100, 0, 0, 0, 0, 0, 10, 0, 0
            )
            datagram = plant.pack(fix) + datagram
        log.write(datagram, 1.7e9 + tick / RATE_HZ)
        answer = common.MAVLink_hil_actuator_controls_message(time_usec, [0.5] * 16, armed, 1)
        log.write(autopilot.pack(answer), 1.7e9 + tick / RATE_HZ)
    log.close()
