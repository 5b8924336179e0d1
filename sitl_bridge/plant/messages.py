"""What the plant says at each tick: HIL_GPS and truth first, HIL_SENSOR last, in one datagram.

Compiled, because it runs at every tick. Frames and units are converted by `sitl_bridge.frames`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sitl_bridge.compiled import Buffer, entry_point, kernel
from sitl_bridge.frames import (
    CENTIDEGREES_PER_RADIAN,
    CENTIMETRES_PER_METRE,
    DEG_E7_PER_DEG,
    GAUSS_PER_TESLA,
    HECTOPASCALS_PER_PASCAL,
    MICROSECONDS_PER_SECOND,
    MILLIMETRES_PER_METRE,
    LocalOrigin,
    attitude_to_ned_frd,
    enu_to_ned,
    flu_to_frd,
    rotate_inverse,
)
from sitl_bridge.ids import COMPONENT_LOAD, COMPONENT_TRUTH, load_system, vehicle_system
from sitl_bridge.mavlink.framing import Bytes, write_frame
from sitl_bridge.mavlink.hil import (
    FRAME_BODY_FRD,
    FRAME_LOCAL_NED,
    HIL_GPS,
    HIL_SENSOR,
    ODOMETRY,
)
from sitl_bridge.plant.sensors.gps import GpsFix
from sitl_bridge.plant.sensors.instruments import MEASUREMENT
from sitl_bridge.plant.state import STATE_SIZE, Array

DATAGRAM_SIZE = 2048  # what PX4 reads at once

OUTGOING = np.dtype(
    [
        ("sensor", HIL_SENSOR.dtype),
        ("gps", HIL_GPS.dtype),
        ("vehicle", ODOMETRY.dtype),
        ("load", ODOMETRY.dtype),
    ]
)
_SENSOR_ID, _GPS_ID, _ODOMETRY_ID = HIL_SENSOR.message_id, HIL_GPS.message_id, ODOMETRY.message_id
_SENSOR_SIZE, _GPS_SIZE = HIL_SENSOR.dtype.itemsize, HIL_GPS.dtype.itemsize
_ODOMETRY_SIZE = ODOMETRY.dtype.itemsize
_GPS_AT = _SENSOR_SIZE
_VEHICLE_AT = _GPS_AT + _GPS_SIZE
_LOAD_AT = _VEHICLE_AT + _ODOMETRY_SIZE

# Elements of the counters that `write_tick` keeps.
VEHICLE_SEQUENCE, LOAD_SEQUENCE, VEHICLE_SYSTEM, LOAD_SYSTEM = range(4)


@kernel
def fill_sensor(out: Any, measured: Any) -> None:
    """HIL_SENSOR from measurements in SI units and body FLU."""
    a, g, m = measured.accelerometer, measured.gyroscope, measured.magnetometer
    out.xacc, out.yacc, out.zacc = flu_to_frd((a[0], a[1], a[2]))
    out.xgyro, out.ygyro, out.zgyro = flu_to_frd((g[0], g[1], g[2]))
    field = flu_to_frd((m[0] * GAUSS_PER_TESLA, m[1] * GAUSS_PER_TESLA, m[2] * GAUSS_PER_TESLA))
    out.xmag, out.ymag, out.zmag = field
    out.abs_pressure = measured.pressure * HECTOPASCALS_PER_PASCAL
    out.diff_pressure = measured.differential_pressure * HECTOPASCALS_PER_PASCAL
    out.pressure_alt = measured.pressure_altitude
    out.temperature = measured.temperature
    out.fields_updated = measured.updated


@kernel
def fill_vehicle_odometry(out: Any, x: Array) -> None:
    """ODOMETRY of the vehicle: LOCAL_NED, velocities in BODY_FRD."""
    q = (x[6], x[7], x[8], x[9])
    out.x, out.y, out.z = enu_to_ned((x[0], x[1], x[2]))
    w, qx, qy, qz = attitude_to_ned_frd(q)
    out.q[0], out.q[1], out.q[2], out.q[3] = w, qx, qy, qz
    out.vx, out.vy, out.vz = flu_to_frd(rotate_inverse(q, (x[3], x[4], x[5])))
    out.rollspeed, out.pitchspeed, out.yawspeed = flu_to_frd((x[10], x[11], x[12]))


@kernel
def fill_load_odometry(out: Any, x: Array) -> None:
    """ODOMETRY of the load: position and velocity in LOCAL_NED; a point has no attitude."""
    out.x, out.y, out.z = enu_to_ned((x[13], x[14], x[15]))
    out.vx, out.vy, out.vz = enu_to_ned((x[16], x[17], x[18]))


@entry_point(
    Buffer(OUTGOING, (1,)),
    Buffer(np.uint8, (OUTGOING.itemsize,)),
    Buffer(MEASUREMENT, (1,)),
    Buffer(np.float64, (STATE_SIZE,)),
    Buffer(np.int64, (4,)),
    Buffer(np.uint8, (DATAGRAM_SIZE,)),
    int,
    int,
    int,
)
def write_tick(
    records: Any,
    payloads: Bytes,
    measurements: Any,
    x: Array,
    counters: Any,
    out: Bytes,
    time_usec: int,
    with_gps: int,
    with_truth: int,
) -> int:
    """Write the frames of one tick into `out`; returns the datagram's length.

    records and payloads share their memory; the GPS record is filled by the caller.
    """
    messages = records[0]
    system = counters[VEHICLE_SYSTEM]
    at = 0
    if with_gps:
        payload = payloads[_GPS_AT : _GPS_AT + _GPS_SIZE]
        at = write_frame(out, at, payload, _GPS_ID, counters[VEHICLE_SEQUENCE], system, COMPONENT_TRUTH)
        counters[VEHICLE_SEQUENCE] = (counters[VEHICLE_SEQUENCE] + 1) & 0xFF
    if with_truth:
        messages.vehicle.time_usec = time_usec
        fill_vehicle_odometry(messages.vehicle, x)
        payload = payloads[_VEHICLE_AT : _VEHICLE_AT + _ODOMETRY_SIZE]
        at = write_frame(out, at, payload, _ODOMETRY_ID, counters[VEHICLE_SEQUENCE], system, COMPONENT_TRUTH)
        counters[VEHICLE_SEQUENCE] = (counters[VEHICLE_SEQUENCE] + 1) & 0xFF
        messages.load.time_usec = time_usec
        fill_load_odometry(messages.load, x)
        payload = payloads[_LOAD_AT : _LOAD_AT + _ODOMETRY_SIZE]
        sequence = counters[LOAD_SEQUENCE]
        at = write_frame(out, at, payload, _ODOMETRY_ID, sequence, counters[LOAD_SYSTEM], COMPONENT_LOAD)
        counters[LOAD_SEQUENCE] = (sequence + 1) & 0xFF
    messages.sensor.time_usec = time_usec
    fill_sensor(messages.sensor, measurements[0])
    payload = payloads[0:_SENSOR_SIZE]
    at = write_frame(out, at, payload, _SENSOR_ID, counters[VEHICLE_SEQUENCE], system, COMPONENT_TRUTH)
    counters[VEHICLE_SEQUENCE] = (counters[VEHICLE_SEQUENCE] + 1) & 0xFF
    return at


class TickWriter:
    """Builds the datagram of each tick for one instance."""

    def __init__(self, instance: int, origin: LocalOrigin, state: Array, measurement: Any) -> None:
        self._origin = origin
        self._records = np.zeros(1, dtype=OUTGOING)
        record = self._records[0]
        record["vehicle"]["frame_id"] = FRAME_LOCAL_NED
        record["vehicle"]["child_frame_id"] = FRAME_BODY_FRD
        record["load"]["frame_id"] = record["load"]["child_frame_id"] = FRAME_LOCAL_NED
        record["load"]["q"][0] = 1.0
        for body in ("vehicle", "load"):  # the first element NaN: covariance unknown
            record[body]["pose_covariance"][0] = record[body]["velocity_covariance"][0] = math.nan
        self._out = np.zeros(DATAGRAM_SIZE, dtype=np.uint8)
        self._view = self._out.data
        counters = np.array([0, 0, vehicle_system(instance), load_system(instance)], dtype=np.int64)
        payloads = self._records.view(np.uint8)
        self._write = write_tick.bind(self._records, payloads, measurement, state, counters, self._out)

    def datagram(self, time_usec: int, gps: GpsFix | None, truth: bool) -> bytes:
        """All frames of a tick: HIL_GPS when there is a fix, ODOMETRY of both when asked for, HIL_SENSOR."""
        if gps is not None:
            self._fill_gps(time_usec, gps)
        length = self._write(time_usec, gps is not None, truth)
        return bytes(self._view[:length])

    def _fill_gps(self, time_usec: int, fix: GpsFix) -> None:
        record = self._records[0]["gps"]
        point = self._origin.geodetic(fix.position)
        north, east, down = enu_to_ned(fix.velocity)
        ground_speed = math.hypot(north, east)
        record["time_usec"] = max(0, time_usec - round(fix.age * MICROSECONDS_PER_SECOND))
        record["lat"] = round(point.latitude * DEG_E7_PER_DEG)
        record["lon"] = round(point.longitude * DEG_E7_PER_DEG)
        record["alt"] = round(point.altitude * MILLIMETRES_PER_METRE)
        record["eph"] = _unsigned(fix.horizontal_accuracy * CENTIMETRES_PER_METRE)
        record["epv"] = _unsigned(fix.vertical_accuracy * CENTIMETRES_PER_METRE)
        record["vel"] = _unsigned(ground_speed * CENTIMETRES_PER_METRE)
        for name, value in (("vn", north), ("ve", east), ("vd", down)):
            record[name] = max(-32768, min(32767, round(value * CENTIMETRES_PER_METRE)))
        course = math.atan2(east, north) % (2 * math.pi)
        record["cog"] = _unsigned(course * CENTIDEGREES_PER_RADIAN) % 36000
        record["fix_type"] = fix.fix_type
        record["satellites_visible"] = fix.satellites


def _unsigned(value: float) -> int:
    """Rounded into an unsigned 16-bit field."""
    return max(0, min(65535, round(value)))
