"""ULog with PX4's topic names, so that tools for PX4's logs read a flight: NED and FRD, time in us.

The vehicle's own topics hold the estimate where the flight had one, else the truth;
`…_groundtruth`, the truth.
PX4 has no topic for the load: it is in `slung_load` and `slung_load_setpoint`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.law.state import WRENCH_SIZE
from controller.law.terms import COMPONENTS, TERMS
from sitl.export.ulog_format import ULogWriter
from sitl.recording.recording import Array, Recording
from sitl.recording.sensors import read_sensors
from sitl_bridge.frames import quaternion_from_euler

_POSITION = tuple((name, "<f4") for name in ("x", "y", "z", "vx", "vy", "vz"))


def _topic(*fields: Any) -> np.dtype[np.void]:
    return np.dtype([("timestamp", "<u8"), *fields])


TOPICS = {
    "vehicle_local_position": _topic(*_POSITION, ("heading", "<f4")),
    "vehicle_local_position_groundtruth": _topic(*_POSITION, ("heading", "<f4")),
    "vehicle_attitude": _topic(("q", "<f4", 4)),
    "vehicle_attitude_groundtruth": _topic(("q", "<f4", 4)),
    "vehicle_angular_velocity": _topic(("xyz", "<f4", 3)),
    "actuator_motors": _topic(("control", "<f4", 12)),
    "sensor_combined": _topic(("gyro_rad", "<f4", 3), ("accelerometer_m_s2", "<f4", 3)),
    "sensor_gps": _topic(
        ("latitude_deg", "<f8"), ("longitude_deg", "<f8"), ("altitude_msl_m", "<f8"), ("fix_type", "u1")
    ),
    "slung_load": _topic(*_POSITION, ("cable_length", "<f4"), ("cable_tension", "<f4")),
    "slung_load_setpoint": _topic(("x", "<f4"), ("y", "<f4"), ("z", "<f4")),
    "law_terms": _topic(*((term, "<f4", WRENCH_SIZE) for term in TERMS)),
}
_NED = [1, 0, 2]
_NED_SIGNS = np.array([1.0, 1.0, -1.0])
_FRD_SIGNS = np.array([1.0, -1.0, -1.0])


def write_ulog(recording: Recording, file: Path) -> None:
    """Write the flight; a topic without samples is left out."""
    topics = {name: records for name, records in _topics(recording).items() if len(records)}
    with file.open("wb") as out:
        writer = ULogWriter(out)
        writer.info("sys_name", "sitl-bridge")
        writer.info("ver_hw", recording.vehicle.name)
        for name, records in topics.items():
            writer.declare(name, records.dtype)
        writer.parameter("SIM_CABLE_LENGTH", recording.vehicle.cable.rest_length)
        writer.parameter("SIM_LOAD_MASS", recording.vehicle.load.mass)
        for number, name in enumerate(topics):
            writer.subscribe(name, number)
        writer.text(0, f"scenario {recording.summary.get('scenario')}, seed {recording.summary.get('seed')}")
        writer.samples(enumerate(topics.values()))


def _topics(recording: Recording) -> dict[str, NDArray[np.void]]:
    times, states = recording.times, recording.states
    quaternion = _attitude(recording.vectors("attitude_q{}", "wxyz"))
    truth = _local(recording.vectors("vehicle_{}_m"), recording.vectors("vehicle_v{}_m_s"))
    rates = recording.vectors("body_rate_{}_rad_s", "pqr") * _FRD_SIGNS
    load = _local(recording.vectors("load_{}_m"), recording.vectors("load_v{}_m_s"))
    controls = np.full((len(times), 12), np.nan)
    given = recording.controls()[:, :12]
    controls[:, : given.shape[1]] = given
    out = {
        "vehicle_local_position_groundtruth": (times, *truth.T, _heading(quaternion)),
        "vehicle_attitude_groundtruth": (times, quaternion),
        "slung_load": (times, *load.T, states["cable_length_m"], states["cable_tension_N"]),
        "slung_load_setpoint": (times, *_ned(recording.reference).T),
        "actuator_motors": (times, controls),
        **_believed(recording, quaternion, truth, rates),
        **_sensed(recording),
        **_terms(recording),
    }
    return {name: _records(name, *columns) for name, columns in out.items()}


def _believed(recording: Recording, quaternion: Array, truth: Array, rates: Array) -> dict[str, Any]:
    """What the autopilot took for the vehicle's state."""
    estimates, times = recording.estimates, recording.times
    if estimates is not None:
        times = estimates["time_s"]
        position, velocity = (
            np.stack([estimates[f"vehicle_{prefix}{axis}{unit}"] for axis in "xyz"], axis=1)
            for prefix, unit in (("", "_m"), ("v", "_m_s"))
        )
        truth = _local(position, velocity)
        angles = np.stack([estimates[f"{name}_rad"] for name in ("roll", "pitch", "yaw")], axis=1)
        quaternion = _attitude(np.array([quaternion_from_euler((r, p, y)) for r, p, y in angles.tolist()]))
        rates = np.stack([estimates[f"body_rate_{axis}_rad_s"] for axis in "pqr"], axis=1) * _FRD_SIGNS
    return {
        "vehicle_local_position": (times, *truth.T, _heading(quaternion)),
        "vehicle_attitude": (times, quaternion),
        "vehicle_angular_velocity": (times, rates),
    }


def _sensed(recording: Recording) -> dict[str, Any]:
    """What the sensors said, where the flight kept its telemetry log."""
    if recording.tlog is None:
        return {}
    log = read_sensors(recording.tlog)
    sensors, fixes = log.sensors, log.fixes
    gyro, force = (np.stack([sensors[f"{axis}{kind}"] for axis in "xyz"], axis=1) for kind in ("gyro", "acc"))
    place = (fixes["lat"] * 1e-7, fixes["lon"] * 1e-7, fixes["alt"] * 1e-3)
    return {
        "sensor_combined": (log.sensor_times, gyro, force),
        "sensor_gps": (log.fix_times, *place, fixes["fix_type"]),
    }


def _terms(recording: Recording) -> dict[str, Any]:
    """What the law's commands were made of: thrust and moments about FRD axes, for each term."""
    log = recording.terms
    if log is None:
        return {}
    signs = np.array([1.0, *_FRD_SIGNS])
    terms = (np.stack([log[f"{term}_{part}"] for part in COMPONENTS], axis=1) * signs for term in TERMS)
    return {"law_terms": (log["time_s"], *terms)}


def _records(topic: str, times: Array, *columns: Array) -> NDArray[np.void]:
    records = np.zeros(len(times), dtype=TOPICS[topic])
    records["timestamp"] = np.round(times * 1e6).astype(np.uint64)
    for name, column in zip((records.dtype.names or ())[1:], columns, strict=True):
        records[name] = column
    return records


def _ned(vectors: Array) -> Array:
    """World vectors (n, 3), ENU to NED."""
    return np.asarray(vectors[:, _NED] * _NED_SIGNS)


def _local(position: Array, velocity: Array) -> Array:
    """(n, 6): position and velocity in NED."""
    return np.hstack((_ned(position), _ned(velocity)))


def _attitude(quaternions: Array) -> Array:
    """(n, 4): FLU to ENU becomes FRD to NED; as `frames.attitude_to_ned_frd` has it, row by row."""
    w, x, y, z = quaternions.T
    half = np.sqrt(0.5)
    out = np.stack((-half * (w + z), -half * (x + y), half * (y - x), half * (z - w)), axis=1)
    return np.asarray(out * np.where(out[:, :1] >= 0.0, 1.0, -1.0))


def _heading(quaternions: Array) -> Array:
    """(n,), rad, from north to the east, of attitudes FRD to NED."""
    w, x, y, z = quaternions.T
    return np.asarray(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
