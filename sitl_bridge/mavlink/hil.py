"""Layout of the few messages that cross the HIL link at every tick, tested byte for byte against pymavlink.

Each layout is the message's MAVLink 2 payload as a packed numpy record: the field names, units and frames
are those of the `common` dialect (NED/FRD and wire units). A record is filled or read by compiled code;
its bytes are the payload.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.ids import ACTUATOR_CONTROLS

Record = NDArray[np.void]


class Layout(NamedTuple):
    """A message's number and the packed record of its payload."""

    message_id: int
    dtype: np.dtype[np.void]

    def record(self) -> tuple[Record, NDArray[np.uint8]]:
        """A zeroed record of shape (1,), and the payload's bytes, which share its memory."""
        record = np.zeros(1, dtype=self.dtype)
        return record, record.view(np.uint8)


def _layout(message_id: int, *fields: tuple[str, str] | tuple[str, str, int]) -> Layout:
    return Layout(message_id, np.dtype(list(fields)))


HIL_SENSOR = _layout(
    107,
    ("time_usec", "<u8"),
    *((name, "<f4") for name in ("xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro", "xmag", "ymag", "zmag")),
    *((name, "<f4") for name in ("abs_pressure", "diff_pressure", "pressure_alt", "temperature")),
    ("fields_updated", "<u4"),
    ("id", "u1"),
)

HIL_GPS = _layout(
    113,
    ("time_usec", "<u8"),
    *((name, "<i4") for name in ("lat", "lon", "alt")),
    *((name, "<u2") for name in ("eph", "epv", "vel")),
    *((name, "<i2") for name in ("vn", "ve", "vd")),
    ("cog", "<u2"),
    *((name, "u1") for name in ("fix_type", "satellites_visible", "id")),
    ("yaw", "<u2"),
)

HIL_ACTUATOR_CONTROLS = _layout(
    93, ("time_usec", "<u8"), ("flags", "<u8"), ("controls", "<f4", ACTUATOR_CONTROLS), ("mode", "u1")
)

ODOMETRY = _layout(
    331,
    ("time_usec", "<u8"),
    *((name, "<f4") for name in ("x", "y", "z")),
    ("q", "<f4", 4),
    *((name, "<f4") for name in ("vx", "vy", "vz", "rollspeed", "pitchspeed", "yawspeed")),
    ("pose_covariance", "<f4", 21),
    ("velocity_covariance", "<f4", 21),
    *((name, "u1") for name in ("frame_id", "child_frame_id", "reset_counter", "estimator_type")),
    ("quality", "i1"),
)

HIL_STATE_QUATERNION = _layout(
    115,
    ("time_usec", "<u8"),
    ("attitude_quaternion", "<f4", 4),
    *((name, "<f4") for name in ("rollspeed", "pitchspeed", "yawspeed")),
    *((name, "<i4") for name in ("lat", "lon", "alt")),
    *((name, "<i2") for name in ("vx", "vy", "vz")),
    *((name, "<u2") for name in ("ind_airspeed", "true_airspeed")),
    *((name, "<i2") for name in ("xacc", "yacc", "zacc")),
)

MODE_FLAG_ARMED = 128
"""Bit of HIL_ACTUATOR_CONTROLS.mode (MAV_MODE_FLAG_SAFETY_ARMED)."""
FLAG_LOCKSTEP = 1
"""Bit of HIL_ACTUATOR_CONTROLS.flags: the autopilot answers tick for tick."""
FRAME_LOCAL_NED = 1
FRAME_BODY_FRD = 12
SENSOR_ALL_FIELDS = 0x1FFF
"""HIL_SENSOR.fields_updated with every group of sensors."""
ROTORS_STOP_AFTER = 0.3
"""s of an autopilot's silence, in real time, after which the plant stops the rotors."""

SENSOR_RESET = 1 << 31
"""HIL_SENSOR.fields_updated: the simulation, and with it every sensor, has begun afresh."""
