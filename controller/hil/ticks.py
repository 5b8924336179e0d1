"""What the plant says in a tick: time, sensors, and truth where it was asked for; compiled."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.law.state import STATE_SIZE, Array
from sitl_bridge.compiled import Buffer, entry_point, kernel
from sitl_bridge.frames import (
    GAUSS_PER_TESLA,
    attitude_to_enu_flu,
    enu_to_ned,
    euler_from_quaternion,
    flu_to_frd,
    rotate,
)
from sitl_bridge.ids import COMPONENT_LOAD, COMPONENT_TRUTH, load_system, vehicle_system
from sitl_bridge.mavlink.framing import (
    COMPONENT,
    LARGEST_DATAGRAM,
    MESSAGE_ID,
    MOST_FRAMES,
    SYSTEM,
    TABLE_COLUMNS,
    Bytes,
    Frame,
    frame_at,
    read_payload,
    scan,
)
from sitl_bridge.mavlink.hil import HIL_GPS, HIL_SENSOR, HIL_STATE_QUATERNION, ODOMETRY, SENSOR_RESET

INCOMING = np.dtype(
    [
        ("sensor", HIL_SENSOR.dtype),
        ("vehicle", ODOMETRY.dtype),
        ("load", ODOMETRY.dtype),
        ("gps", HIL_GPS.dtype),
    ]
)
SENSED = np.dtype(
    [
        ("accelerometer", "f8", 3),  # specific force, m/s², body FLU
        ("gyroscope", "f8", 3),  # rad/s, body FLU
        ("magnetometer", "f8", 3),  # T, body FLU
        ("altitude", "f8"),  # m above mean sea level, from the pressure
        ("has_imu", "b1"),  # new in this tick, likewise the others
        ("has_magnetometer", "b1"),
        ("has_altitude", "b1"),
        ("has_begun", "b1"),  # the plant's sensors have begun afresh with this tick
    ],
    align=True,
)
"""HIL_SENSOR in SI units and the autopilot's frames."""
_IMU_BITS, _MAGNETOMETER_BITS, _ALTITUDE_BIT = 0x3F, 0x1C0, 0x800
"""Of HIL_SENSOR.fields_updated."""
_SENSOR_ID, _GPS_ID, _ODOMETRY_ID = HIL_SENSOR.message_id, HIL_GPS.message_id, ODOMETRY.message_id
_STATE_ID = HIL_STATE_QUATERNION.message_id
_SENSOR_SIZE, _ODOMETRY_SIZE = HIL_SENSOR.dtype.itemsize, ODOMETRY.dtype.itemsize
_LOAD_AT, _GPS_AT = _SENSOR_SIZE + _ODOMETRY_SIZE, _SENSOR_SIZE + 2 * _ODOMETRY_SIZE

# What `read_tick` found, as bits.
TICK, VEHICLE_TRUTH, LOAD_TRUTH, OTHERS, GPS = 1, 2, 4, 8, 16


@kernel
def plant_seconds(time_usec: int) -> float:
    """The plant's time, s."""
    return time_usec * 1e-6


@kernel
def estimate_from_truth(vehicle: Any, load: Any, estimate: Array) -> None:
    """Eq. 31's state (18,), ENU and FLU, from ODOMETRY of vehicle (velocities in BODY_FRD) and load."""
    q = vehicle.q
    size = (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]) ** 0.5
    attitude = attitude_to_enu_flu((q[0] / size, q[1] / size, q[2] / size, q[3] / size))
    estimate[0], estimate[1], estimate[2] = enu_to_ned((vehicle.x, vehicle.y, vehicle.z))
    estimate[3], estimate[4], estimate[5] = enu_to_ned((load.x, load.y, load.z))
    body_velocity = flu_to_frd((vehicle.vx, vehicle.vy, vehicle.vz))
    estimate[6], estimate[7], estimate[8] = rotate(attitude, body_velocity)
    estimate[9], estimate[10], estimate[11] = enu_to_ned((load.vx, load.vy, load.vz))
    rates = flu_to_frd((vehicle.rollspeed, vehicle.pitchspeed, vehicle.yawspeed))
    estimate[12], estimate[13], estimate[14] = rates
    estimate[15], estimate[16], estimate[17] = euler_from_quaternion(attitude)


@kernel
def read_sensors(sensor: Any, out: Any) -> None:
    """SENSED from HIL_SENSOR."""
    a = flu_to_frd((sensor.xacc, sensor.yacc, sensor.zacc))
    g = flu_to_frd((sensor.xgyro, sensor.ygyro, sensor.zgyro))
    m = flu_to_frd((sensor.xmag, sensor.ymag, sensor.zmag))
    for i in range(3):
        out.accelerometer[i] = a[i]
        out.gyroscope[i] = g[i]
        out.magnetometer[i] = m[i] / GAUSS_PER_TESLA
    out.altitude = sensor.pressure_alt
    bits = int(sensor.fields_updated)
    out.has_imu = bits & _IMU_BITS == _IMU_BITS
    out.has_magnetometer = bits & _MAGNETOMETER_BITS == _MAGNETOMETER_BITS
    out.has_altitude = bits & _ALTITUDE_BIT != 0
    out.has_begun = bits & SENSOR_RESET != 0


INBOX = np.dtype(
    [
        ("header", "i8", 2),  # number of frames, time_usec of HIL_SENSOR
        ("systems", "i8", 2),  # system ids of vehicle and load
        ("estimate", "f8", STATE_SIZE),  # from the truth, eq. 31, ENU and FLU
        ("sensed", SENSED, (1,)),  # of the last HIL_SENSOR
        ("messages", INCOMING, (1,)),
        ("frames", np.int32, (MOST_FRAMES + 1, TABLE_COLUMNS)),  # where each frame stands, see `scan`
        ("data", "u1", LARGEST_DATAGRAM),
    ],
    align=True,
)
"""A datagram from the plant, and what was found in it."""
_MESSAGES_AT: int = INBOX.fields["messages"][1]  # type: ignore[index]  # the type has fields

READ_BUFFERS = (Buffer(INBOX, (1,)), Buffer(np.uint8, (INCOMING.itemsize,)))
"""The array arguments of `read_tick`; `TickReader.buffers` has them."""


@entry_point(*READ_BUFFERS, int)
def read_tick(inboxes: Any, payloads: Bytes, length: int) -> int:
    """Read the inbox's data[:length]; returns bits of what was found.

    payloads: the bytes of the inbox's messages, the same memory. With truth of both bodies, the inbox's
    estimate is written; truth that is not finite is none.
    """
    inbox = inboxes[0]
    data, table, header, estimate = inbox.data, inbox.frames, inbox.header, inbox.estimate
    records, sensed = inbox.messages, inbox.sensed
    vehicle_sys, load_sys = inbox.systems[0], inbox.systems[1]
    count = scan(data, table, length)
    header[0] = count
    found = 0
    for i in range(count):
        message_id = table[i, MESSAGE_ID]
        system, component = table[i, SYSTEM], table[i, COMPONENT]
        if message_id == _SENSOR_ID:
            read_payload(data, table[i], payloads[:_SENSOR_SIZE])
            found |= TICK
        elif message_id == _ODOMETRY_ID and system == vehicle_sys and component == COMPONENT_TRUTH:
            read_payload(data, table[i], payloads[_SENSOR_SIZE:_LOAD_AT])
            found |= VEHICLE_TRUTH
        elif message_id == _ODOMETRY_ID and system == load_sys and component == COMPONENT_LOAD:
            read_payload(data, table[i], payloads[_LOAD_AT:_GPS_AT])
            found |= LOAD_TRUTH
        elif message_id == _GPS_ID:
            read_payload(data, table[i], payloads[_GPS_AT:])
            found |= GPS
        elif message_id != _STATE_ID:
            found |= OTHERS
    if found & TICK:
        header[1] = records[0].sensor.time_usec
        read_sensors(records[0].sensor, sensed[0])
    if found & VEHICLE_TRUTH and found & LOAD_TRUTH:
        estimate_from_truth(records[0].vehicle, records[0].load, estimate)
        for i in range(STATE_SIZE):
            if not math.isfinite(estimate[i]):
                found &= ~VEHICLE_TRUTH
    return found


class Tick(NamedTuple):
    """What a datagram from the plant held."""

    time_usec: int | None
    """Of HIL_SENSOR; None when the datagram had none."""
    truth: bool
    """Whether `TickReader.estimate` holds the truth of this tick."""
    gps: bool
    """Whether `TickReader.gps` is new."""
    others: list[Frame]


class TickReader:
    """Reads datagrams from the plant of one instance."""

    def __init__(self, instance: int) -> None:
        inbox = np.zeros(1, dtype=INBOX)
        fields = inbox[0]
        self.estimate: Array = fields["estimate"]
        """State (18,) of the latest truth, eq. 31, ENU and FLU."""
        self.sensed: NDArray[Any] = fields["sensed"]
        """The latest tick's record of SENSED, shape (1,)."""
        fields["systems"] = vehicle_system(instance), load_system(instance)
        self._table: NDArray[np.int32] = fields["frames"]
        self.view = fields["data"].data
        """Where a datagram is put to be read."""
        self._header = fields["header"].data  # numbers come faster out of a memoryview
        self.gps = fields["messages"][0]["gps"]
        """The latest HIL_GPS, a record as on the wire."""
        self.buffers = (inbox, inbox.view(np.uint8)[_MESSAGES_AT : _MESSAGES_AT + INCOMING.itemsize])
        """The arrays of `read_tick`."""
        self._read = read_tick.bind(*self.buffers)

    @property
    def time_usec(self) -> int:
        """Of the latest HIL_SENSOR."""
        return int(self._header[1])

    @property
    def begun(self) -> bool:
        """Whether the plant's sensors have begun afresh with the latest tick."""
        return bool(self.sensed["has_begun"][0])

    def read(self, datagram: bytes) -> Tick:
        """Everything in a datagram (at most 65536 bytes)."""
        length = len(datagram)
        self.view[:length] = datagram
        found = self._read(length)
        others: list[Frame] = []
        if found & OTHERS:
            rows = self._table[: self._header[0]].tolist()
            known = (_SENSOR_ID, _GPS_ID, _ODOMETRY_ID, _STATE_ID)
            others = [frame_at(datagram, row) for row in rows if row[MESSAGE_ID] not in known]
        truth = bool(found & VEHICLE_TRUTH and found & LOAD_TRUTH)
        return Tick(self.time_usec if found & TICK else None, truth, bool(found & GPS), others)
