"""From MAVLink to a `View`: listens as a ground station does, and asks the autopilot for what draws smoothly.

A protocol object without I/O. It takes ODOMETRY of vehicle and load, else HIL_STATE_QUATERNION,
else GLOBAL_POSITION_INT with ATTITUDE_QUATERNION or ATTITUDE. Junk and unknown messages are ignored.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import Any

from pymavlink.dialects.v20 import common as mavlink
from pymavlink.mavutil import mode_string_v10

from controller.ground.flight.px4_modes import Mode, find_mode
from controller.ground.missions.transfer import FENCE, MISSION, RALLY
from sitl.view.plan import plan_of
from sitl.view.plan_download import PlanDownload
from sitl.view.view import View
from sitl_bridge.frames import (
    DEG_E7_PER_DEG,
    MILLIMETRES_PER_METRE,
    Geodetic,
    LocalOrigin,
    Quaternion,
    Triple,
    attitude_to_enu_flu,
    enu_to_ned,
    quaternion_from_euler,
    yaw_from_heading,
)
from sitl_bridge.ids import COMPONENT_AUTOPILOT, COMPONENT_LOAD, COMPONENT_TRUTH, load_system
from sitl_bridge.mavlink.framing import Frame, Packer, decode, split
from sitl_bridge.plant.wire.figures import CHAIN, SCENARIO_TIME, TENSION
from sitl_bridge.plant.wire.speed import SPEED, STEPS

STATION_SYSTEM = 254
"""Ours; 255 is QGroundControl's."""
HEARTBEAT_INTERVAL = 1.0
"""s"""
RATE_HZ = 30.0
"""Asked of the autopilot for what moves."""
STALE = 1.0
"""s after which a better source that has fallen silent gives way to another."""
MOST_TEXTS = 8
FAR = 20_000.0
"""m from the described home beyond which the first position is taken for the origin."""
_WANTED = (mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
_ODOMETRY, _TRUTH, _TELEMETRY = 3, 2, 1
"""Sources of a body's pose, the better the larger."""


class Listener:
    """What one vehicle and its load say.

    home: where the world's origin lies, if it is known; else the first position is the origin.
    node_count: of the vehicle's cable, if it is a chain.
    """

    def __init__(self, home: LocalOrigin | None = None, node_count: int = 0) -> None:
        self.view = View()
        """What is known now."""
        self._origin = home
        self._node_count = node_count
        self._checked_home = False
        self._vehicle_system: int | None = None
        self._station = Packer(STATION_SYSTEM, mavlink.MAV_COMP_ID_MISSIONPLANNER)
        self._next_heartbeat = 0.0
        self._asked: set[int] = set()
        self._out: list[bytes] = []
        self._sources: dict[str, tuple[int, float]] = {}
        self._texts: deque[str] = deque(maxlen=MOST_TEXTS)
        self._first_usec: int | None = None
        self._plant_system: int | None = None
        self._plans = PlanDownload(STATION_SYSTEM, mavlink.MAV_COMP_ID_MISSIONPLANNER)

    def next_deadline(self) -> float:
        """When `to_send` has something at the latest."""
        return min(self._next_heartbeat, self._plans.next_deadline())

    def to_send(self, now: float) -> list[bytes]:
        """Our HEARTBEAT once a second, and requests for messages."""
        out, self._out = self._out, []
        if now >= self._next_heartbeat:
            self._next_heartbeat = now + HEARTBEAT_INTERVAL
            heartbeat = mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
            )
            out.append(self._station.pack(heartbeat))
            if self._plant_system is not None and not self.view.steerable:
                wanted = mavlink.MAVLink_param_request_list_message(self._plant_system, COMPONENT_TRUTH)
                out.append(self._station.pack(wanted))
        return out + [self._station.pack(message) for message in self._plans.to_send(now)]

    def set_plant(self, name: str, value: float) -> None:
        """Set a parameter of the plant, if there is one to set: SIM_SPEEDUP or SIM_STEPS."""
        if self._plant_system is None or not self.view.steerable:
            return
        message = mavlink.MAVLink_param_set_message(
            self._plant_system, COMPONENT_TRUTH, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32
        )
        self._out.append(self._station.pack(message))

    def receive(self, datagram: bytes, now: float) -> None:
        """Take in what somebody says."""
        for frame in split(datagram).frames:
            self.take(frame, now)

    def take(self, frame: Frame, now: float) -> None:
        """Take in one frame."""
        handler = _HANDLERS.get(frame.message_id)
        if handler is None:
            return
        try:
            message = decode(frame)
        except Exception:  # pymavlink raises many kinds of errors for a payload that it can't unpack
            return
        handler(self, frame, message, now)

    def _is_load(self, frame: Frame) -> bool:
        if frame.component == COMPONENT_LOAD:
            return True
        return self._vehicle_system is not None and frame.system == load_system(self._vehicle_system - 1)

    def _place(
        self, frame: Frame, source: int, now: float, position: Triple, attitude: Quaternion | None
    ) -> None:
        """Set a body's pose unless a better source spoke lately."""
        if not all(map(math.isfinite, position)):
            return
        body = "load" if self._is_load(frame) else "vehicle"
        best, heard = self._sources.get(body, (0, -math.inf))
        if source < best and now - heard < STALE:
            return
        self._sources[body] = (source, now)
        if body == "load":
            self.view = replace(self.view, load=position)
        elif attitude is None:
            self.view = replace(self.view, vehicle=position)
        else:
            self.view = replace(self.view, vehicle=position, attitude=attitude)

    def _local(self, message: Any) -> Triple:
        """ENU m from the origin of a message with latitude, longitude (1e-7 deg) and altitude (mm)."""
        point = Geodetic(
            message.lat / DEG_E7_PER_DEG, message.lon / DEG_E7_PER_DEG, message.alt / MILLIMETRES_PER_METRE
        )
        if self._origin is None:
            self._origin = LocalOrigin(*point)
        elif not self._checked_home:
            self._checked_home = True
            if math.hypot(*self._origin.local(point)) > FAR:
                self._origin = LocalOrigin(*point)
        return self._origin.local(point)

    def _clock(self, time_usec: int) -> None:
        if self._first_usec is None or time_usec < self._first_usec:
            self._first_usec = time_usec
        self.view = replace(self.view, time_s=(time_usec - self._first_usec) * 1e-6)

    def _on_heartbeat(self, frame: Frame, message: Any, now: float) -> None:
        if message.autopilot == mavlink.MAV_AUTOPILOT_INVALID or frame.component != COMPONENT_AUTOPILOT:
            return
        if self._vehicle_system is None:
            self._vehicle_system = frame.system
        if frame.system != self._vehicle_system:
            return
        armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        self.view = replace(self.view, armed=armed, mode=mode_name(message))
        if frame.system not in self._asked:
            self._asked.add(frame.system)
            self._out += [self._request(frame.system, wanted) for wanted in _WANTED]
            self._plans.begin(frame.system, now)

    def _request(self, system: int, message_id: int) -> bytes:
        command = mavlink.MAVLink_command_long_message(
            system,
            COMPONENT_AUTOPILOT,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
            0,
            *(message_id, 1e6 / RATE_HZ, 0, 0, 0, 0, 0),
        )
        return self._station.pack(command)

    def _on_odometry(self, frame: Frame, message: Any, now: float) -> None:
        self._clock(message.time_usec)
        attitude = attitude_to_enu_flu(tuple(message.q))
        self._place(frame, _ODOMETRY, now, enu_to_ned((message.x, message.y, message.z)), attitude)

    def _on_parameter(self, frame: Frame, message: Any, now: float) -> None:
        """The plant's: one that counts steps can be paused."""
        if frame.system != self._plant_system or frame.component != COMPONENT_TRUTH:
            return
        if message.param_id == STEPS:
            self.view = replace(self.view, steerable=True)
        if message.param_id == SPEED:
            self.view = replace(self.view, speed=message.param_value)

    def _on_state(self, frame: Frame, message: Any, now: float) -> None:
        if frame.component == COMPONENT_TRUTH:
            self._plant_system = frame.system
        self._clock(message.time_usec)
        attitude = attitude_to_enu_flu(tuple(message.attitude_quaternion))
        self._place(frame, _TRUTH, now, self._local(message), attitude)

    def _on_global_position(self, frame: Frame, message: Any, now: float) -> None:
        self._place(frame, _TELEMETRY, now, self._local(message), None)

    def _on_attitude_quaternion(self, frame: Frame, message: Any, now: float) -> None:
        self._turn(now, attitude_to_enu_flu((message.q1, message.q2, message.q3, message.q4)))

    def _on_attitude(self, frame: Frame, message: Any, now: float) -> None:
        euler = (message.roll, -message.pitch, yaw_from_heading(message.yaw))
        self._turn(now, quaternion_from_euler(euler))

    def _turn(self, now: float, attitude: Quaternion) -> None:
        best, heard = self._sources.get("vehicle", (0, -math.inf))
        if (best <= _TELEMETRY or now - heard >= STALE) and all(map(math.isfinite, attitude)):
            self.view = replace(self.view, attitude=attitude)

    def _on_controls(self, frame: Frame, message: Any, now: float) -> None:
        speeds = tuple(c if math.isfinite(c) else 0.0 for c in message.controls)
        armed = bool(message.mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        self.view = replace(self.view, rotors=speeds if armed else (0.0,) * len(speeds))

    def _on_battery(self, frame: Frame, message: Any, now: float) -> None:
        if message.battery_remaining >= 0:
            self.view = replace(self.view, battery=message.battery_remaining / 100.0)

    def _on_text(self, frame: Frame, message: Any, now: float) -> None:
        text = message.text if isinstance(message.text, str) else message.text.decode(errors="replace")
        self._texts.append(text.rstrip("\0"))
        self.view = replace(self.view, texts=tuple(self._texts))

    def _on_target(self, frame: Frame, message: Any, now: float) -> None:
        target = enu_to_ned((message.x, message.y, message.z))
        if all(map(math.isfinite, target)):
            self.view = replace(self.view, set_point=target)

    def _on_figure(self, frame: Frame, message: Any, now: float) -> None:
        """The plant's own figures; see `plant.wire.figures`."""
        if message.name == TENSION:
            self.view = replace(self.view, tension=message.value)
        elif message.name == SCENARIO_TIME and math.isfinite(message.value):
            self._first_usec = 1000 * message.time_boot_ms - round(message.value * 1e6)
            self.view = replace(self.view, time_s=message.value, of_scenario=True)

    def _on_array(self, frame: Frame, message: Any, now: float) -> None:
        name = message.name.rstrip("\0") if isinstance(message.name, str) else ""
        if name != CHAIN or not all(map(math.isfinite, message.data)):
            return
        count = self._node_count
        parts = message.data[: 3 * count]
        nodes = tuple(enu_to_ned((parts[3 * i], parts[3 * i + 1], parts[3 * i + 2])) for i in range(count))
        self.view = replace(self.view, nodes=nodes)

    def _on_plan(self, frame: Frame, message: Any, now: float) -> None:
        if self._plans.take(message, frame.system, now) and self._origin is not None:
            items = self._plans.items
            plan = plan_of(items[MISSION], items[FENCE], items[RALLY], self._origin)
            if plan != self.view.plan:
                self.view = replace(self.view, plan=plan)

    def _on_mission_current(self, frame: Frame, message: Any, now: float) -> None:
        if frame.system == self._vehicle_system:
            self._plans.current(frame, now)

    def _on_wind(self, frame: Frame, message: Any, now: float) -> None:
        self.view = replace(self.view, wind=enu_to_ned((message.wind_x, message.wind_y, message.wind_z)))


def mode_name(heartbeat: Any) -> str:
    """The mode as a ground station calls it."""
    if heartbeat.autopilot == mavlink.MAV_AUTOPILOT_PX4:
        mode = find_mode(heartbeat.custom_mode >> 16 & 0xFF, heartbeat.custom_mode >> 24)
        if isinstance(mode, Mode):
            return mode.title
    return str(mode_string_v10(heartbeat))


_HANDLERS = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: Listener._on_heartbeat,
    mavlink.MAVLINK_MSG_ID_PARAM_VALUE: Listener._on_parameter,
    mavlink.MAVLINK_MSG_ID_ODOMETRY: Listener._on_odometry,
    mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION: Listener._on_state,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: Listener._on_global_position,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: Listener._on_attitude_quaternion,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: Listener._on_attitude,
    mavlink.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS: Listener._on_controls,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: Listener._on_battery,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: Listener._on_battery,
    mavlink.MAVLINK_MSG_ID_STATUSTEXT: Listener._on_text,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: Listener._on_target,
    mavlink.MAVLINK_MSG_ID_WIND_COV: Listener._on_wind,
    mavlink.MAVLINK_MSG_ID_MISSION_COUNT: Listener._on_plan,
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT: Listener._on_plan,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: Listener._on_mission_current,
    mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT: Listener._on_figure,
    mavlink.MAVLINK_MSG_ID_DEBUG_FLOAT_ARRAY: Listener._on_array,
}
