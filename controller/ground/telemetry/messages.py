"""Telemetry: messages from what the control loop sees. ENU/FLU and SI become wire units here, by `frames`."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.commands.setpoints import NOTHING
from controller.ground.files import metadata
from controller.ground.flight.guidance import Stage
from controller.ground.flight.modes import Machine
from controller.ground.flight.motion.patterns import FigureEight, Orbit
from controller.ground.flight.motion.setpoint_types import Body, Follow, Goto, Land
from controller.ground.flight.px4_modes import Mode
from controller.ground.link.heartbeat import heartbeat
from controller.ground.link.packing import (
    AvailableModes,
    ComponentInformation,
    ComponentMetadata,
    CurrentMode,
    FigureEightStatus,
)
from controller.ground.telemetry.vehicle_state import VehicleView
from sitl_bridge.frames import (
    CENTIAMPERES_PER_AMPERE,
    CENTIDEGREES_PER_RADIAN,
    CENTIMETRES_PER_METRE,
    DEG_E7_PER_DEG,
    MICROSECONDS_PER_SECOND,
    MILLIMETRES_PER_METRE,
    MILLISECONDS_PER_SECOND,
    MILLIVOLTS_PER_VOLT,
    PERCENT,
    Geodetic,
    Triple,
    attitude_to_ned_frd,
    enu_to_ned,
    euler_from_quaternion,
    flu_to_frd,
    heading_from_yaw,
    rotate_inverse,
)
from sitl_bridge.mavlink.fields import (
    CELLS,
    FURTHER_CELLS,
    NOT_KNOWN_INT16,
    NOT_KNOWN_UINT16,
    pack_voltages,
    whole,
)

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
_HEALTH_BITS = (
    (mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO, "gyroscope"),
    (mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL, "accelerometer"),
    (mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG, "magnetometer"),
    (mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE, "barometer"),
    (mavlink.MAV_SYS_STATUS_SENSOR_GPS, "gps"),
    (mavlink.MAV_SYS_STATUS_AHRS, "attitude"),
)
_BATTERY = mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
_FENCE = mavlink.MAV_SYS_STATUS_GEOFENCE
_PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK

Builder = Callable[[Machine, VehicleView], Any]


def _milliseconds(view: VehicleView) -> int:
    return int(view.time * MILLISECONDS_PER_SECOND) & 0xFFFFFFFF


def _microseconds(view: VehicleView) -> int:
    return whole(view.time * MICROSECONDS_PER_SECOND, 64, signed=False)


def _place(machine: Machine, position: Triple) -> tuple[int, int, int]:
    """Latitude and longitude in degrees times 1e7, altitude above mean sea level in mm."""
    point = machine.profile.origin.geodetic(position)
    return _wire_place(point)


def _wire_place(point: Geodetic) -> tuple[int, int, int]:
    return (
        whole(point.latitude * DEG_E7_PER_DEG, 32),
        whole(point.longitude * DEG_E7_PER_DEG, 32),
        whole(point.altitude * MILLIMETRES_PER_METRE, 32),
    )


def _above_home(machine: Machine, height: float) -> float:
    return height - (machine.home[2] if machine.home is not None else 0.0)


def _heading(view: VehicleView) -> float:
    """Compass heading, rad, 0..2π."""
    return heading_from_yaw(euler_from_quaternion(view.attitude)[2]) % (2 * math.pi)


def _rates(view: VehicleView) -> Triple:
    return flu_to_frd(view.body_rates)


def _attitude(machine: Machine, view: VehicleView) -> Any:
    euler = euler_from_quaternion(attitude_to_ned_frd(view.attitude))
    return mavlink.MAVLink_attitude_message(_milliseconds(view), *euler, *_rates(view))


def _attitude_quaternion(machine: Machine, view: VehicleView) -> Any:
    q = attitude_to_ned_frd(view.attitude)
    return mavlink.MAVLink_attitude_quaternion_message(_milliseconds(view), *q, *_rates(view))


def _local_position(machine: Machine, view: VehicleView) -> Any:
    position, velocity = enu_to_ned(view.position), enu_to_ned(view.velocity)
    return mavlink.MAVLink_local_position_ned_message(_milliseconds(view), *position, *velocity)


def _global_position(machine: Machine, view: VehicleView) -> Any:
    velocity = (whole(v * CENTIMETRES_PER_METRE, 16) for v in enu_to_ned(view.velocity))
    return mavlink.MAVLink_global_position_int_message(
        _milliseconds(view),
        *_place(machine, view.position),
        whole(_above_home(machine, view.position[2]) * MILLIMETRES_PER_METRE, 32),
        *velocity,
        whole(_heading(view) * CENTIDEGREES_PER_RADIAN, 16, signed=False) % 36000,
    )


def _gps_raw(machine: Machine, view: VehicleView) -> Any:
    gps = view.gps
    east, north, _ = gps.velocity
    course = heading_from_yaw(math.atan2(north, east)) % (2 * math.pi) * CENTIDEGREES_PER_RADIAN
    return mavlink.MAVLink_gps_raw_int_message(
        _microseconds(view),
        gps.fix_type,
        *((0, 0, 0) if gps.position is None else _wire_place(gps.position)),
        # Dilution of precision times 100: of receivers with 1 m at a dilution of 1.
        whole(gps.horizontal_accuracy * 100, 16, signed=False, unknown=NOT_KNOWN_UINT16),
        whole(gps.vertical_accuracy * 100, 16, signed=False, unknown=NOT_KNOWN_UINT16),
        whole(math.hypot(east, north) * CENTIMETRES_PER_METRE, 16, signed=False, unknown=NOT_KNOWN_UINT16),
        NOT_KNOWN_UINT16 if math.isnan(course) else whole(course, 16, signed=False) % 36000,
        gps.satellites,
        h_acc=whole(gps.horizontal_accuracy * MILLIMETRES_PER_METRE, 32, signed=False),
        v_acc=whole(gps.vertical_accuracy * MILLIMETRES_PER_METRE, 32, signed=False),
    )


def _vfr_hud(machine: Machine, view: VehicleView) -> Any:
    speed = math.hypot(view.velocity[0], view.velocity[1])
    return mavlink.MAVLink_vfr_hud_message(
        math.hypot(*view.velocity),
        speed,
        whole(math.degrees(_heading(view)), 16) % 360,
        whole(view.throttle * PERCENT, 16, signed=False),
        machine.profile.origin.home.altitude + view.position[2],
        view.velocity[2],
    )


def _sys_status(machine: Machine, view: VehicleView) -> Any:
    lost = math.isinf(view.hil_age) or view.hil_age > machine.parameters["COM_HIL_LOSS_T"]
    present = _BATTERY | _FENCE | _PREARM
    healthy = 0 if "fence" in machine.failsafes.active else _FENCE
    if not view.battery_remaining < machine.parameters["BAT_LOW_THR"]:
        healthy |= _BATTERY
    # In flight the checks for arming are over: what is wrong then is in the other bits and in texts.
    if machine.armed or not machine.arming_faults():
        healthy |= _PREARM
    for bit, name in _HEALTH_BITS:
        present |= bit
        if getattr(view.health, name) and not lost:
            healthy |= bit
    return mavlink.MAVLink_sys_status_message(
        present,
        present,
        healthy,
        0,  # load: in lockstep the loop's share of the processor says nothing about the vehicle
        whole(view.battery_voltage * MILLIVOLTS_PER_VOLT, 16, signed=False, unknown=NOT_KNOWN_UINT16),
        whole(view.battery_current * CENTIAMPERES_PER_AMPERE, 16, unknown=-1),
        whole(view.battery_remaining * PERCENT, 8, unknown=-1),
        *(0,) * 6,
    )


def landed_state(machine: Machine, view: VehicleView) -> int:
    """MAV_LANDED_STATE."""
    if machine.armed and machine.stage is Stage.ASCENT:
        return int(mavlink.MAV_LANDED_STATE_TAKEOFF)
    if machine.armed and machine.stage is Stage.DESCENT:
        return int(mavlink.MAV_LANDED_STATE_LANDING)
    grounded = view.vehicle_on_ground or (not machine.profile.has_ground and not machine.armed)
    return int(mavlink.MAV_LANDED_STATE_ON_GROUND if grounded else mavlink.MAV_LANDED_STATE_IN_AIR)


def _extended_sys_state(machine: Machine, view: VehicleView) -> Any:
    return mavlink.MAVLink_extended_sys_state_message(0, landed_state(machine, view))


def _altitude(machine: Machine, view: VehicleView) -> Any:
    height = view.position[2]
    amsl = machine.profile.origin.home.altitude + height
    above = _above_home(machine, height)
    clearance = above if machine.profile.has_ground else math.nan
    return mavlink.MAVLink_altitude_message(
        _microseconds(view), amsl, amsl, height, above, math.nan, clearance
    )


def cell_voltages(pack: float, cells: int) -> tuple[list[int], list[int]]:
    """BATTERY_STATUS.voltages and .voltages_ext, mV, of a pack (V, NaN: not known) that is shared evenly."""
    if not math.isfinite(pack):
        return [NOT_KNOWN_UINT16] * CELLS, [0] * FURTHER_CELLS
    if cells > CELLS + FURTHER_CELLS:
        return pack_voltages(pack), [0] * FURTHER_CELLS
    each = [whole(pack * MILLIVOLTS_PER_VOLT / cells, 16, signed=False)] * cells
    first, further = each[:CELLS], each[CELLS:]
    return (
        first + [NOT_KNOWN_UINT16] * (CELLS - len(first)),
        further + [0] * (FURTHER_CELLS - len(further)),
    )


def _battery_status(machine: Machine, view: VehicleView) -> Any:
    voltages, further = cell_voltages(view.battery_voltage, machine.parameters.integer("BAT1_N_CELLS"))
    return mavlink.MAVLink_battery_status_message(
        0,
        mavlink.MAV_BATTERY_FUNCTION_ALL,
        mavlink.MAV_BATTERY_TYPE_LIPO,
        NOT_KNOWN_INT16,
        voltages,
        whole(view.battery_current * CENTIAMPERES_PER_AMPERE, 16, unknown=-1),
        -1,
        -1,
        whole(view.battery_remaining * PERCENT, 8, unknown=-1),
        0,
        _charge_state(machine, view),
        further,
    )


def _charge_state(machine: Machine, view: VehicleView) -> int:
    left, p = view.battery_remaining, machine.parameters
    if math.isnan(left):
        return int(mavlink.MAV_BATTERY_CHARGE_STATE_UNDEFINED)
    for limit, state in (
        (p["BAT_EMERGEN_THR"], mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY),
        (p["BAT_CRIT_THR"], mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL),
        (p["BAT_LOW_THR"], mavlink.MAV_BATTERY_CHARGE_STATE_LOW),
    ):
        if left < limit:
            return int(state)
    return int(mavlink.MAV_BATTERY_CHARGE_STATE_OK)


def _home_position(machine: Machine, view: VehicleView) -> Any:
    if machine.home is None:
        return None
    approach = (math.nan, math.nan, math.nan)
    return mavlink.MAVLink_home_position_message(
        *_place(machine, machine.home),
        *enu_to_ned(machine.home),
        (1.0, 0.0, 0.0, 0.0),
        *approach,
        _microseconds(view),
    )


def _mission_current(machine: Machine) -> Any:
    flight = machine.mission
    total = len(flight.items)
    return mavlink.MAVLink_mission_current_message(
        flight.current, total or 0xFFFF, flight.state, 1 if machine.mode.name == "MISSION" else 2
    )


def _position_target(machine: Machine, view: VehicleView) -> Any:
    target = machine.target
    if not isinstance(target, Goto | Follow | Land):
        return None
    position = target.position
    if target.body is Body.LOAD:
        # Everything else in the vehicle's telemetry is the vehicle's, so this is too.
        position = (position[0], position[1], position[2] + machine.profile.hover_length)
    velocity = target.velocity if isinstance(target, Follow) else NOTHING
    acceleration = target.acceleration if isinstance(target, Follow) else NOTHING
    rate = target.yaw_rate if isinstance(target, Follow) else math.nan
    if isinstance(target, Land):
        position, velocity = (position[0], position[1], math.nan), (math.nan, math.nan, -target.speed)
    fields = (*enu_to_ned(position), *enu_to_ned(velocity), *enu_to_ned(acceleration))
    mask = sum(1 << bit for bit, value in enumerate(fields) if math.isnan(value))
    mask |= (1 << 10) * math.isnan(target.yaw) | (1 << 11) * math.isnan(rate)
    heading = heading_from_yaw(target.yaw) if math.isfinite(target.yaw) else math.nan
    return mavlink.MAVLink_position_target_local_ned_message(
        _milliseconds(view), mavlink.MAV_FRAME_LOCAL_NED, mask, *fields, heading, -rate
    )


def _odometry(machine: Machine, view: VehicleView) -> Any:
    from_world = flu_to_frd(_in_body(view))
    unknown = [math.nan] * 21
    return mavlink.MAVLink_odometry_message(
        _microseconds(view),
        mavlink.MAV_FRAME_LOCAL_NED,
        mavlink.MAV_FRAME_BODY_FRD,
        *enu_to_ned(view.position),
        attitude_to_ned_frd(view.attitude),
        *from_world,
        *_rates(view),
        unknown,
        unknown,
        0,
        mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT,
        100 if view.health.position else 0,
    )


def _in_body(view: VehicleView) -> Triple:
    return rotate_inverse(view.attitude, view.velocity)


def _highres_imu(machine: Machine, view: VehicleView) -> Any:
    missing = (0.0,) * 7
    return mavlink.MAVLink_highres_imu_message(
        _microseconds(view), *flu_to_frd(view.acceleration), *_rates(view), *missing, 0x3F
    )


def _system_time(machine: Machine, view: VehicleView) -> Any:
    return mavlink.MAVLink_system_time_message(0, _milliseconds(view))


def _current_mode(machine: Machine) -> Any:
    mode = machine.mode
    return CurrentMode(mode.standard_mode, mode.custom_mode, mode.custom_mode)


def _estimator_status(machine: Machine, view: VehicleView) -> Any:
    health, quality = view.health, view.quality
    flags = mavlink.ESTIMATOR_ATTITUDE * health.attitude
    if quality.velocity if quality is not None else health.position:
        flags |= mavlink.ESTIMATOR_VELOCITY_HORIZ | mavlink.ESTIMATOR_VELOCITY_VERT
    if health.position:
        flags |= mavlink.ESTIMATOR_POS_HORIZ_ABS | mavlink.ESTIMATOR_POS_VERT_ABS
    ratios = (0.0,) * 6
    accuracy = (0.0, 0.0)  # of the truth
    if quality is not None:
        flags |= mavlink.ESTIMATOR_CONST_POS_MODE * quality.dead_reckoning
        flags |= mavlink.ESTIMATOR_GPS_GLITCH * quality.gps_glitch
        # of velocity, horizontal position, height, magnetometer; then what is not fitted
        ratios = (
            quality.velocity_ratio,
            quality.position_ratio,
            quality.height_ratio,
            quality.heading_ratio,
            math.nan,
            math.nan,
        )
        accuracy = (quality.horizontal_accuracy, quality.vertical_accuracy)
    return mavlink.MAVLink_estimator_status_message(_microseconds(view), flags, *ratios, *accuracy)


def _orbit_status(machine: Machine, view: VehicleView) -> Any:
    orbit = machine.pattern
    if not isinstance(orbit, Orbit) or machine.stage is not Stage.FLYING:
        return None
    x, y, altitude = _place(machine, orbit.centre)
    return mavlink.MAVLink_orbit_execution_status_message(
        _microseconds(view),
        -orbit.sense * orbit.radius,
        mavlink.MAV_FRAME_GLOBAL_INT,
        x,
        y,
        altitude / MILLIMETRES_PER_METRE,
    )


def _winch_status(machine: Machine, view: VehicleView) -> Any:
    winch = machine.payload.winch
    if winch is None or winch.report is None:
        return None
    return mavlink.MAVLink_winch_status_message(
        _microseconds(view),
        winch.report.length,
        winch.report.speed,
        winch.report.tension,
        math.nan,
        math.nan,
        NOT_KNOWN_INT16,
        winch.status,
    )


def _figure_eight_status(machine: Machine, view: VehicleView) -> Any:
    figure = machine.pattern
    if not isinstance(figure, FigureEight) or machine.stage is not Stage.FLYING:
        return None
    x, y, altitude = _place(machine, figure.centre)
    place = (x, y, altitude / MILLIMETRES_PER_METRE)
    frame, axis = mavlink.MAV_FRAME_GLOBAL_INT, heading_from_yaw(figure.axis)
    return FigureEightStatus(
        _microseconds(view), figure.sense * figure.major, figure.minor, axis, frame, place
    )


BUILDERS: dict[int, Builder] = {
    mavlink.MAVLINK_MSG_ID_ORBIT_EXECUTION_STATUS: _orbit_status,
    FigureEightStatus.id: _figure_eight_status,
    mavlink.MAVLINK_MSG_ID_WINCH_STATUS: _winch_status,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: _attitude,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: _attitude_quaternion,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: _local_position,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _global_position,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: _gps_raw,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: _vfr_hud,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: _sys_status,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: _extended_sys_state,
    mavlink.MAVLINK_MSG_ID_ALTITUDE: _altitude,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: _battery_status,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: _home_position,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: _position_target,
    mavlink.MAVLINK_MSG_ID_ODOMETRY: _odometry,
    mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: _highres_imu,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: _system_time,
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: _estimator_status,
}
"""By message number; each needs a view."""


def build(message_id: int, machine: Machine) -> Any:
    """A message as it is now; None if there is none of this number, or nothing to say in it yet."""
    if message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
        return heartbeat(machine)
    if message_id == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
        return autopilot_version(machine)
    if message_id in (ComponentMetadata.id, ComponentInformation.id):
        kind = ComponentMetadata if message_id == ComponentMetadata.id else ComponentInformation
        time = 0 if machine.view is None else _milliseconds(machine.view)
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
    place = _wire_place(machine.profile.origin.home)
    time = 0 if machine.view is None else _microseconds(machine.view)
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
