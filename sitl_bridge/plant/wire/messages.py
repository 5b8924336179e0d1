"""What the plant says at each tick: slow frames, HIL_GPS and truth first, HIL_SENSOR last, in one datagram.

Compiled, because it runs at every tick. Frames and units are converted by `sitl_bridge.frames`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.compiled import Buffer, entry_point, kernel
from sitl_bridge.frames import (
    CENTIDEGREES_PER_RADIAN,
    CENTIMETRES_PER_METRE,
    DEG_E7_PER_DEG,
    GAUSS_PER_TESLA,
    HECTOPASCALS_PER_PASCAL,
    MICROSECONDS_PER_SECOND,
    MILLI_G_PER_METRE_PER_SECOND_SQUARED,
    MILLIMETRES_PER_METRE,
    LocalOrigin,
    attitude_to_ned_frd,
    enu_to_ned,
    flu_to_frd,
    rotate_inverse,
)
from sitl_bridge.ids import COMPONENT_LOAD, COMPONENT_TRUTH, load_system, vehicle_system
from sitl_bridge.mavlink.fields import whole
from sitl_bridge.mavlink.framing import Bytes, Packer, write_frame
from sitl_bridge.mavlink.hil import (
    FRAME_BODY_FRD,
    FRAME_LOCAL_NED,
    HIL_GPS,
    HIL_SENSOR,
    HIL_STATE_QUATERNION,
    ODOMETRY,
)
from sitl_bridge.plant.physics.state import STATE_SIZE, Array
from sitl_bridge.plant.physics.world import World
from sitl_bridge.plant.sensors.atmosphere import GAS_CONSTANT, ZERO_CELSIUS, air_density
from sitl_bridge.plant.sensors.gps import GpsFix
from sitl_bridge.plant.sensors.instruments import MEASUREMENT

DATAGRAM_SIZE = 2048  # what PX4 reads at once

OUTGOING = np.dtype(
    [
        ("sensor", HIL_SENSOR.dtype),
        ("gps", HIL_GPS.dtype),
        ("vehicle", ODOMETRY.dtype),
        ("load", ODOMETRY.dtype),
        ("state", HIL_STATE_QUATERNION.dtype),
    ]
)
_SENSOR_ID, _GPS_ID, _ODOMETRY_ID = HIL_SENSOR.message_id, HIL_GPS.message_id, ODOMETRY.message_id
_SENSOR_SIZE, _GPS_SIZE = HIL_SENSOR.dtype.itemsize, HIL_GPS.dtype.itemsize
_ODOMETRY_SIZE = ODOMETRY.dtype.itemsize
_STATE_ID, _STATE_SIZE = HIL_STATE_QUATERNION.message_id, HIL_STATE_QUATERNION.dtype.itemsize
_GPS_AT = _SENSOR_SIZE
_VEHICLE_AT = _GPS_AT + _GPS_SIZE
_LOAD_AT = _VEHICLE_AT + _ODOMETRY_SIZE
_STATE_AT = _LOAD_AT + _ODOMETRY_SIZE
# `write_tick` is told what to send besides HIL_SENSOR, as bits.
GPS, TRUTH, STATE = 1, 2, 4
_SEA_LEVEL_DENSITY = air_density(0.0)

# Elements of the counters that `write_tick` keeps.
VEHICLE_SEQUENCE, LOAD_SEQUENCE, VEHICLE_SYSTEM, LOAD_SYSTEM = range(4)


@kernel
def is_due(pace: Array, time_usec: int) -> bool:
    """Whether a message goes out at this tick, to be asked once a tick; see `Paced` for pace (2,)."""
    if time_usec < pace[1]:
        return False
    pace[1] = max(pace[1] + pace[0], time_usec)
    return True


class Paced:
    """A message that goes out at an interval, on average, as near as ticks allow.

    `pace`: the interval and when it is due next, us.
    """

    def __init__(self, pace: Array) -> None:
        """pace: (2,), written."""
        self.pace = pace
        self.pace[:] = 0.0, math.inf

    def every(self, interval_us: float) -> None:
        """As SET_MESSAGE_INTERVAL has it: microseconds; 0: at every tick; negative: never."""
        self.pace[:] = (interval_us, math.inf if interval_us < 0 else 0.0)

    def due(self, time_usec: int) -> bool:
        """Whether it goes out at this tick; to be asked once a tick."""
        return bool(is_due(self.pace, time_usec))


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


@kernel
def clipped(value: float, low: int, high: int) -> int:
    """Rounded into an integer field."""
    return int(min(max(math.floor(value + 0.5), low), high))


@kernel
def fill_state(out: Any, x: Array, truth: Any, wind: Array, geodesy: Array) -> None:
    """HIL_STATE_QUATERNION: attitude FRD to NED, position, velocity NED, specific force FRD as felt.

    wind (6,): m/s at vehicle and load; geodesy (5,): latitude and longitude (deg) and altitude (m) of home,
    degrees of longitude per metre east and of latitude per metre north.
    """
    q = attitude_to_ned_frd((x[6], x[7], x[8], x[9]))
    for i in range(4):
        out.attitude_quaternion[i] = q[i]
    out.rollspeed, out.pitchspeed, out.yawspeed = flu_to_frd((x[10], x[11], x[12]))
    out.lat = clipped((geodesy[0] + x[1] * geodesy[4]) * DEG_E7_PER_DEG, -0x80000000, 0x7FFFFFFF)
    out.lon = clipped((geodesy[1] + x[0] * geodesy[3]) * DEG_E7_PER_DEG, -0x80000000, 0x7FFFFFFF)
    out.alt = clipped((geodesy[2] + x[2]) * MILLIMETRES_PER_METRE, -0x80000000, 0x7FFFFFFF)
    v = enu_to_ned((x[3], x[4], x[5]))
    out.vx = clipped(v[0] * CENTIMETRES_PER_METRE, -0x8000, 0x7FFF)
    out.vy = clipped(v[1] * CENTIMETRES_PER_METRE, -0x8000, 0x7FFF)
    out.vz = clipped(v[2] * CENTIMETRES_PER_METRE, -0x8000, 0x7FFF)
    through_air = math.sqrt((x[3] - wind[0]) ** 2 + (x[4] - wind[1]) ** 2 + (x[5] - wind[2]) ** 2)
    density = truth.pressure / (GAS_CONSTANT * (truth.temperature + ZERO_CELSIUS))
    indicated = through_air * math.sqrt(density / _SEA_LEVEL_DENSITY)
    out.true_airspeed = clipped(through_air * CENTIMETRES_PER_METRE, 0, 0xFFFF)
    out.ind_airspeed = clipped(indicated * CENTIMETRES_PER_METRE, 0, 0xFFFF)
    a = flu_to_frd((truth.accelerometer[0], truth.accelerometer[1], truth.accelerometer[2]))
    out.xacc = clipped(a[0] * MILLI_G_PER_METRE_PER_SECOND_SQUARED, -0x8000, 0x7FFF)
    out.yacc = clipped(a[1] * MILLI_G_PER_METRE_PER_SECOND_SQUARED, -0x8000, 0x7FFF)
    out.zacc = clipped(a[2] * MILLI_G_PER_METRE_PER_SECOND_SQUARED, -0x8000, 0x7FFF)


OUTBOX = np.dtype(
    [
        ("geodesy", "f8", 5),  # see `fill_state`
        ("counters", "i8", 4),  # sequence numbers and systems, by the names above
        ("state_pace", "f8", 2),  # of HIL_STATE_QUATERNION, see `Paced`
        ("messages", OUTGOING, (1,)),
        ("datagram", "u1", DATAGRAM_SIZE),
    ],
    align=True,
)
"""What the plant says: the messages, and the datagram with their frames."""
_MESSAGES_AT: int = OUTBOX.fields["messages"][1]  # type: ignore[index]  # the type has fields

WRITE_BUFFERS = (Buffer(OUTBOX, (1,)), Buffer(np.uint8, (OUTGOING.itemsize,)))
"""The first array arguments of `write_tick`; `TickWriter.arrays` has them."""


@entry_point(
    *WRITE_BUFFERS,
    Buffer(MEASUREMENT, (1,)),
    Buffer(MEASUREMENT, (1,)),
    Buffer(np.float64, (STATE_SIZE,)),
    Buffer(np.float64, (6,)),
    int,
    int,
)
def write_tick(
    outboxes: Any,
    payloads: Bytes,
    measurements: Any,
    truth: Any,
    x: Array,
    wind: Array,
    time_usec: int,
    wanted: int,
) -> int:
    """Write the frames of one tick into the outbox's datagram; returns its length.

    payloads: the bytes of the outbox's messages, the same memory; the GPS message is filled by the caller.
    measurements: what the sensors read, truth: what ideal ones would; wind as for `fill_state`; wanted: bits.
    """
    outbox = outboxes[0]
    counters, geodesy, out = outbox.counters, outbox.geodesy, outbox.datagram
    messages = outbox.messages[0]
    system = counters[VEHICLE_SYSTEM]
    at = 0
    if wanted & GPS:
        payload = payloads[_GPS_AT : _GPS_AT + _GPS_SIZE]
        at = write_frame(out, at, payload, _GPS_ID, counters[VEHICLE_SEQUENCE], system, COMPONENT_TRUTH)
        counters[VEHICLE_SEQUENCE] = (counters[VEHICLE_SEQUENCE] + 1) & 0xFF
    if wanted & STATE:
        messages.state.time_usec = time_usec
        fill_state(messages.state, x, truth[0], wind, geodesy)
        payload = payloads[_STATE_AT : _STATE_AT + _STATE_SIZE]
        at = write_frame(out, at, payload, _STATE_ID, counters[VEHICLE_SEQUENCE], system, COMPONENT_TRUTH)
        counters[VEHICLE_SEQUENCE] = (counters[VEHICLE_SEQUENCE] + 1) & 0xFF
    if wanted & TRUTH:
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


class CountedPacker(Packer):
    """Packs single frames of a sender whose sequence numbers `write_tick` counts too."""

    def __init__(self, system: int, component: int, counters: NDArray[np.int64], place: int) -> None:
        super().__init__(system, component)
        self._counters, self._place = counters, place

    def next_sequence(self) -> int:
        """The sequence number for the next frame."""
        sequence = int(self._counters[self._place])
        self._counters[self._place] = (sequence + 1) & 0xFF
        return sequence


class TickWriter:
    """Builds the datagram of each tick for one instance."""

    def __init__(self, instance: int, origin: LocalOrigin, world: World) -> None:
        self._origin = origin
        outbox = np.zeros(1, dtype=OUTBOX)
        fields = outbox[0]
        records: NDArray[Any] = fields["messages"]
        record = records[0]
        self._gps = records["gps"]
        record["vehicle"]["frame_id"] = FRAME_LOCAL_NED
        record["vehicle"]["child_frame_id"] = FRAME_BODY_FRD
        record["load"]["frame_id"] = record["load"]["child_frame_id"] = FRAME_LOCAL_NED
        record["load"]["q"][0] = 1.0
        for body in ("vehicle", "load"):  # the first element NaN: covariance unknown
            record[body]["pose_covariance"][0] = record[body]["velocity_covariance"][0] = math.nan
        self._view = fields["datagram"].data
        counters: NDArray[np.int64] = fields["counters"]
        counters[:] = 0, 0, vehicle_system(instance), load_system(instance)
        fields["geodesy"] = [*origin.home, *origin.degrees_per_metre]
        payloads = outbox.view(np.uint8)[_MESSAGES_AT : _MESSAGES_AT + OUTGOING.itemsize]
        self.arrays = (outbox, payloads)
        """What `tick.fly_whole_tick` needs of the writer, in its order, as it changes."""
        self._write = write_tick.bind(*self.arrays, *world.sensed())
        self.state = Paced(fields["state_pace"])
        """When HIL_STATE_QUATERNION goes out."""
        self.vehicle = CountedPacker(vehicle_system(instance), COMPONENT_TRUTH, counters, VEHICLE_SEQUENCE)
        """Packs other frames of the plant about the vehicle."""
        self.load = CountedPacker(load_system(instance), COMPONENT_LOAD, counters, LOAD_SEQUENCE)
        """Packs other frames of the load."""

    def datagram(self, time_usec: int, gps: GpsFix | None, wanted: int) -> bytes:
        """The frames of a tick: HIL_GPS when there is a fix, HIL_STATE_QUATERNION when it is due, what is
        wanted (TRUTH or 0), HIL_SENSOR."""
        if gps is not None:
            self._fill_gps(time_usec, gps)
            wanted |= GPS
        if self.state.due(time_usec):
            wanted |= STATE
        return self.written(self._write(time_usec, wanted))

    def written(self, length: int) -> bytes:
        """The datagram of this length that was written last."""
        return bytes(self._view[:length])

    def _fill_gps(self, time_usec: int, fix: GpsFix) -> None:
        point = self._origin.geodetic(fix.position)
        north, east, down = enu_to_ned(fix.velocity)
        ground_speed = math.hypot(north, east)
        course = math.atan2(east, north) % (2 * math.pi)
        # All at once, in the order of HIL_GPS: field by field takes several times as long.
        self._gps[0] = (
            max(0, time_usec - round(fix.age * MICROSECONDS_PER_SECOND)),
            whole(point.latitude * DEG_E7_PER_DEG, 32),
            whole(point.longitude * DEG_E7_PER_DEG, 32),
            whole(point.altitude * MILLIMETRES_PER_METRE, 32),
            whole(fix.horizontal_accuracy * CENTIMETRES_PER_METRE, 16, signed=False),
            whole(fix.vertical_accuracy * CENTIMETRES_PER_METRE, 16, signed=False),
            whole(ground_speed * CENTIMETRES_PER_METRE, 16, signed=False),
            whole(north * CENTIMETRES_PER_METRE, 16),
            whole(east * CENTIMETRES_PER_METRE, 16),
            whole(down * CENTIMETRES_PER_METRE, 16),
            whole(course * CENTIDEGREES_PER_RADIAN, 16, signed=False) % 36000,
            fix.fix_type,
            fix.satellites,
            0,  # id
            0,  # yaw: not available
        )
