"""Which message goes to one peer how often."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.commands.result import OK, Verdict, deny
from controller.ground.link.packing import CurrentMode, FigureEightStatus

FASTEST = 250.0
"""Hz, of any message"""
_SHORTEST_INTERVAL = 1.0 / FASTEST
SPREAD = 0.1
"""s, over which a new peer's streams begin"""
FASTEST_DATA_STREAM = 50.0
"""Hz, of a group asked for by REQUEST_DATA_STREAM"""

DEFAULT_RATES: dict[int, float] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 10.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 10.0,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 10.0,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 10.0,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 2.0,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 4.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0,
    mavlink.MAVLINK_MSG_ID_ALTITUDE: 1.0,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: 0.5,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: 1.0,
    CurrentMode.id: 0.5,
    mavlink.MAVLINK_MSG_ID_ORBIT_EXECUTION_STATUS: 2.0,
    FigureEightStatus.id: 2.0,
    mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE: 1.0,
    mavlink.MAVLINK_MSG_ID_WINCH_STATUS: 2.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET: 2.0,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: 1.0,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: 1.0,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: 1.0,
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 0.5,
}
"""Hz, of each message that is sent unasked. PX4's 50 Hz makes clients on a busy machine drop some."""

ONBOARD_RATES: dict[int, float] = {
    mavlink.MAVLINK_MSG_ID_ODOMETRY: 10.0,
    mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: 10.0,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
}
"""Hz, of what goes to companions unasked besides: as on PX4, whose scripts wait for it"""

ON_REQUEST = (
    mavlink.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS,
    mavlink.MAVLINK_MSG_ID_FLIGHT_INFORMATION,
)
"""Messages that can be streamed and are not unless asked for."""

STREAMABLE = (*DEFAULT_RATES, *ONBOARD_RATES, *ON_REQUEST)

WITHOUT_DATA = frozenset(
    (
        mavlink.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED,
        mavlink.MAVLINK_MSG_ID_CAMERA_TRIGGER,
        mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR,
        mavlink.MAVLINK_MSG_ID_EFI_STATUS,
        290,  # ESC_INFO and ESC_STATUS of the current `common` dialect
        291,
        mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS,
        mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS,
        mavlink.MAVLINK_MSG_ID_GPS2_RAW,
        mavlink.MAVLINK_MSG_ID_GPS_STATUS,
        mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION,
        mavlink.MAVLINK_MSG_ID_MOUNT_ORIENTATION,
        mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT,
        mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE,
        mavlink.MAVLINK_MSG_ID_OPTICAL_FLOW_RAD,
        mavlink.MAVLINK_MSG_ID_RAW_RPM,
        mavlink.MAVLINK_MSG_ID_RC_CHANNELS,
        mavlink.MAVLINK_MSG_ID_SCALED_IMU,
        mavlink.MAVLINK_MSG_ID_SCALED_IMU2,
        mavlink.MAVLINK_MSG_ID_SCALED_IMU3,
        mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE,
        mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE2,
        mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE3,
        mavlink.MAVLINK_MSG_ID_UTM_GLOBAL_POSITION,
        mavlink.MAVLINK_MSG_ID_VIBRATION,
        mavlink.MAVLINK_MSG_ID_WIND_COV,
    )
)
"""What PX4 streams of sensors that are not here: any rate is taken, as on a PX4 without them"""

_GROUPS: dict[int, tuple[int, ...]] = {
    mavlink.MAV_DATA_STREAM_RAW_SENSORS: (mavlink.MAVLINK_MSG_ID_HIGHRES_IMU,),
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
    ),
    mavlink.MAV_DATA_STREAM_POSITION: (
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    ),
    mavlink.MAV_DATA_STREAM_EXTRA1: (
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
    ),
    mavlink.MAV_DATA_STREAM_EXTRA2: (mavlink.MAVLINK_MSG_ID_VFR_HUD, mavlink.MAVLINK_MSG_ID_ALTITUDE),
    mavlink.MAV_DATA_STREAM_EXTRA3: (mavlink.MAVLINK_MSG_ID_HOME_POSITION,),
}
_GROUPS[mavlink.MAV_DATA_STREAM_ALL] = tuple(
    message_id
    for group in list(_GROUPS.values())
    for message_id in group
    if message_id in DEFAULT_RATES | ONBOARD_RATES
)


class Streams:
    """The schedule of one peer."""

    def __init__(self, now: float, onboard: bool = False) -> None:
        """onboard: to a companion, by the link for them."""
        self._defaults = DEFAULT_RATES | ONBOARD_RATES if onboard else DEFAULT_RATES
        self._intervals = {message_id: 1.0 / rate for message_id, rate in self._defaults.items()}
        # HEARTBEAT first; the others spread out, so that no tick of the control loop has to build them all.
        spread = SPREAD / len(self._intervals)
        self._due = {message_id: now + index * spread for index, message_id in enumerate(self._intervals)}
        self.next = now
        """When something is due again; inf if nothing is."""

    def interval(self, message_id: int) -> float | None:
        """Seconds between two messages, None if it is not sent."""
        return self._intervals.get(message_id)

    def set_interval(self, message_id: float, microseconds: float, now: float) -> Verdict:
        """MAV_CMD_SET_MESSAGE_INTERVAL: 0 or unset is the default rate, -1 off."""
        if message_id in WITHOUT_DATA:
            return OK
        if message_id not in STREAMABLE:
            return deny(
                f"Message {message_id:g} cannot be streamed; docs/ground-control.md lists those that can"
            )
        number = int(message_id)
        default = self._defaults.get(number)
        if math.isnan(microseconds) or microseconds == 0:
            self._set(number, 1.0 / default if default else None, now)
        elif microseconds == -1:
            if number == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
                return deny(
                    "HEARTBEAT cannot be turned off: a ground station would report the vehicle as lost"
                )
            self._set(number, None, now)
        elif microseconds < 0 or not math.isfinite(microseconds):
            least = f"{_SHORTEST_INTERVAL * 1e6:g} and more"
            return deny(f"Interval {microseconds:g} us: use -1 (off), 0 (default) or {least}")
        elif microseconds * 1e-6 < _SHORTEST_INTERVAL * 0.999:
            return deny(
                f"Message {number}: at most {FASTEST:g} Hz, an interval of {_SHORTEST_INTERVAL * 1e6:g} us"
            )
        else:
            slowest = 1.0 if number == mavlink.MAVLINK_MSG_ID_HEARTBEAT else math.inf
            self._set(number, min(microseconds * 1e-6, slowest), now)
        return OK

    def set_group(self, group: int, rate: float, on: bool, now: float) -> None:
        """REQUEST_DATA_STREAM, as MAVProxy sends it: every message of a group at one rate (Hz)."""
        for message_id in _GROUPS.get(group, ()):
            self._set(message_id, 1.0 / min(rate, FASTEST_DATA_STREAM) if on and rate > 0 else None, now)

    def _set(self, message_id: int, interval: float | None, now: float) -> None:
        if interval == self._intervals.get(message_id):
            return
        self._intervals.pop(message_id, None)
        self._due.pop(message_id, None)
        if interval is not None:
            self._intervals[message_id] = interval
            self._due[message_id] = now
        self.next = min(self._due.values(), default=math.inf)

    def hasten(self, message_ids: tuple[int, ...], now: float) -> None:
        """Send these now, if they are streamed at all."""
        for message_id in message_ids:
            if message_id in self._due:
                self._due[message_id] = now
                self.next = min(self.next, now)

    def due(self, now: float) -> list[int]:
        """The messages to send now. Each keeps its own grid; what was missed is not made up in a burst."""
        if now < self.next:
            return []
        ready = [message_id for message_id, due in self._due.items() if due <= now]
        for message_id in ready:
            due = self._due[message_id] + self._intervals[message_id]
            self._due[message_id] = due if due > now else now + self._intervals[message_id]
        self.next = min(self._due.values(), default=math.inf)
        return ready
