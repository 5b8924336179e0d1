"""Telemetry: messages from what the control loop sees. ENU/FLU and SI become wire units in `units`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.files import metadata
from controller.ground.flight.modes import Machine
from controller.ground.flight.px4_modes import Mode
from controller.ground.link.heartbeat import heartbeat
from controller.ground.link.packing import (
    AvailableModes,
    ComponentInformation,
    ComponentMetadata,
    CurrentMode,
    FigureEightStatus,
    ProtocolVersion,
)
from controller.ground.missions.plan_id import MissionCurrent
from controller.ground.telemetry import motion_messages as motion
from controller.ground.telemetry import state_messages as state
from controller.ground.telemetry.units import (
    microseconds,
    milliseconds,
    wire_place,
)
from controller.ground.telemetry.vehicle_state import VehicleView

CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
    | mavlink.MAV_PROTOCOL_CAPABILITY_FTP
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_FLIGHT_TERMINATION
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)
VERSION = (0, 1, 0)
"""Of this autopilot, as AUTOPILOT_VERSION has it"""
_UID = 0x5349544C << 8
"""Hardware id; the instance is added, so that stations tell vehicles apart"""
Builder = Callable[[Machine, VehicleView], Any]


def _mission_current(machine: Machine) -> Any:
    flight = machine.mission
    total = len(flight.items)
    flies = 1 if machine.mode is Mode.MISSION else 2
    return MissionCurrent(flight.current, total or 0xFFFF, flight.state, flies, machine.plan_ids)


def _current_mode(machine: Machine) -> Any:
    mode = machine.mode
    return CurrentMode(mode.standard_mode, mode.custom_mode, mode.custom_mode)


BUILDERS: dict[int, Builder] = {
    mavlink.MAVLINK_MSG_ID_ORBIT_EXECUTION_STATUS: motion.orbit_status,
    FigureEightStatus.id: motion.figure_eight_status,
    mavlink.MAVLINK_MSG_ID_WINCH_STATUS: state.winch_status,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: motion.attitude,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: motion.attitude_quaternion,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: motion.local_position,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: motion.global_position,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: state.gps_raw,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: motion.vfr_hud,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: state.sys_status,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: state.extended_sys_state,
    mavlink.MAVLINK_MSG_ID_FLIGHT_INFORMATION: state.flight_information,
    mavlink.MAVLINK_MSG_ID_ALTITUDE: motion.altitude,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: state.battery_status,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: motion.home_position,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: motion.position_target,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: motion.position_target_global,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET: motion.attitude_target,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: state.servo_output,
    mavlink.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS: state.actuator_output,
    mavlink.MAVLINK_MSG_ID_ODOMETRY: motion.odometry,
    mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: motion.highres_imu,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: state.system_time,
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: state.estimator_status,
}
"""By message number; each needs a view."""


def build(message_id: int, machine: Machine) -> Any:
    """A message as it is now; None if there is none of this number, or nothing to say in it yet."""
    if message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
        return heartbeat(machine)
    if message_id == ProtocolVersion.id:
        return ProtocolVersion()
    if message_id == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
        return autopilot_version(machine)
    if message_id in (ComponentMetadata.id, ComponentInformation.id):
        kind = ComponentMetadata if message_id == ComponentMetadata.id else ComponentInformation
        time = 0 if machine.view is None else milliseconds(machine.view)
        return kind(time, metadata.general_crc(), metadata.uri(metadata.GENERAL))
    if message_id == mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN:
        return global_origin(machine)
    if message_id == CurrentMode.id:
        return _current_mode(machine)
    if message_id == mavlink.MAVLINK_MSG_ID_MISSION_CURRENT:
        return _mission_current(machine)
    builder = BUILDERS.get(message_id)
    return builder(machine, machine.view) if builder is not None and machine.view is not None else None


def global_origin(machine: Machine) -> Any:
    """GPS_GLOBAL_ORIGIN: of the local frame."""
    place = wire_place(machine.profile.origin.home)
    time = 0 if machine.view is None else microseconds(machine.view)
    return mavlink.MAVLink_gps_global_origin_message(*place, time)


def autopilot_version(machine: Machine) -> Any:
    """AUTOPILOT_VERSION."""
    version = VERSION[0] << 24 | VERSION[1] << 16 | VERSION[2] << 8 | mavlink.FIRMWARE_VERSION_TYPE_DEV
    empty = [0] * 8
    uid = _UID + machine.profile.instance
    gripper = mavlink.MAV_PROTOCOL_CAPABILITY_GRIPPER if machine.payload.gripper is not None else 0
    return mavlink.MAVLink_autopilot_version_message(
        CAPABILITIES | gripper, version, version, 0, 0, empty, empty, empty, 0, 0, uid
    )


def available_modes(index: float) -> list[Any]:
    """AVAILABLE_MODES of one mode (1, 2, …), or of all (0)."""
    count = len(Mode)
    return [
        AvailableModes(count, number, mode.standard_mode, mode.custom_mode, mode.properties, mode.title)
        for number, mode in enumerate(Mode, start=1)
        if index in (0, number)
    ]
