"""Messages about the state of sensors, estimate, battery, mission and winch."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.guidance import Stage
from controller.ground.flight.modes import Machine
from controller.ground.telemetry.units import (
    microseconds,
    milliseconds,
    wire_place,
)
from controller.ground.telemetry.vehicle_state import VehicleView
from sitl_bridge.frames import (
    CENTIAMPERES_PER_AMPERE,
    CENTIDEGREES_PER_RADIAN,
    CENTIMETRES_PER_METRE,
    MILLIMETRES_PER_METRE,
    MILLIVOLTS_PER_VOLT,
    PERCENT,
    heading_from_yaw,
)
from sitl_bridge.mavlink.fields import (
    CELLS,
    FURTHER_CELLS,
    NOT_KNOWN_INT16,
    NOT_KNOWN_UINT16,
    pack_voltages,
    whole,
)

_PULSE, _PULSE_RANGE = 1000.0, 1000.0
"""us: the pulse of a rotor that stands, and how much longer it is at full speed"""
_SERVOS, _ACTUATORS = 16, 32
"""That the messages have room for"""
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


def gps_raw(machine: Machine, view: VehicleView) -> Any:
    """GPS_RAW_INT."""
    gps = view.gps
    east, north, _ = gps.velocity
    course = heading_from_yaw(math.atan2(north, east)) % (2 * math.pi) * CENTIDEGREES_PER_RADIAN
    return mavlink.MAVLink_gps_raw_int_message(
        microseconds(view),
        gps.fix_type,
        *((0, 0, 0) if gps.position is None else wire_place(gps.position)),
        # Dilution of precision times 100: of receivers with 1 m at a dilution of 1.
        whole(gps.horizontal_accuracy * 100, 16, signed=False, unknown=NOT_KNOWN_UINT16),
        whole(gps.vertical_accuracy * 100, 16, signed=False, unknown=NOT_KNOWN_UINT16),
        whole(math.hypot(east, north) * CENTIMETRES_PER_METRE, 16, signed=False, unknown=NOT_KNOWN_UINT16),
        NOT_KNOWN_UINT16 if math.isnan(course) else whole(course, 16, signed=False) % 36000,
        gps.satellites,
        h_acc=whole(gps.horizontal_accuracy * MILLIMETRES_PER_METRE, 32, signed=False),
        v_acc=whole(gps.vertical_accuracy * MILLIMETRES_PER_METRE, 32, signed=False),
    )


def sys_status(machine: Machine, view: VehicleView) -> Any:
    """SYS_STATUS."""
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
    if not view.estimated:
        return int(mavlink.MAV_LANDED_STATE_UNDEFINED)
    if machine.armed and machine.stage is Stage.ASCENT:
        return int(mavlink.MAV_LANDED_STATE_TAKEOFF)
    if machine.armed and machine.stage is Stage.DESCENT:
        return int(mavlink.MAV_LANDED_STATE_LANDING)
    grounded = view.vehicle_on_ground or (not machine.profile.has_ground and not machine.armed)
    return int(mavlink.MAV_LANDED_STATE_ON_GROUND if grounded else mavlink.MAV_LANDED_STATE_IN_AIR)


def extended_sys_state(machine: Machine, view: VehicleView) -> Any:
    """EXTENDED_SYS_STATE."""
    return mavlink.MAVLink_extended_sys_state_message(0, landed_state(machine, view))


def flight_information(machine: Machine, view: VehicleView) -> Any:
    """FLIGHT_INFORMATION: times since the autopilot's start, us; 0: not yet."""
    armed_at = machine.armed_at if machine.armed else math.nan
    times = (0 if math.isnan(t) else round(t * 1e6) for t in (armed_at, machine.guidance.took_off_at))
    return mavlink.MAVLink_flight_information_message(milliseconds(view), *times, machine.flights)


def servo_output(machine: Machine, view: VehicleView) -> Any:
    """SERVO_OUTPUT_RAW: the rotors' commands as pulses; none without."""
    pulses = [round(_PULSE + _PULSE_RANGE * min(max(u, 0.0), 1.0)) for u in view.rotors[:_SERVOS]]
    first = pulses[:8] + [0] * (8 - len(pulses))
    further = pulses[8:] + [0] * (8 - len(pulses[8:]))
    return mavlink.MAVLink_servo_output_raw_message(microseconds(view) & 0xFFFFFFFF, 0, *first, *further)


def actuator_output(machine: Machine, view: VehicleView) -> Any:
    """ACTUATOR_OUTPUT_STATUS: the rotors' commands, 0..1."""
    values = list(view.rotors[:_ACTUATORS])
    padded = values + [0.0] * (_ACTUATORS - len(values))
    return mavlink.MAVLink_actuator_output_status_message(microseconds(view), len(values), padded)


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


def battery_status(machine: Machine, view: VehicleView) -> Any:
    """BATTERY_STATUS."""
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


def system_time(machine: Machine, view: VehicleView) -> Any:
    """SYSTEM_TIME."""
    return mavlink.MAVLink_system_time_message(0, milliseconds(view))


def estimator_status(machine: Machine, view: VehicleView) -> Any:
    """ESTIMATOR_STATUS."""
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
    return mavlink.MAVLink_estimator_status_message(microseconds(view), flags, *ratios, *accuracy)


def winch_status(machine: Machine, view: VehicleView) -> Any:
    """WINCH_STATUS."""
    winch = machine.payload.winch
    if winch is None or winch.report is None:
        return None
    return mavlink.MAVLink_winch_status_message(
        microseconds(view),
        winch.report.length,
        winch.report.speed,
        winch.report.tension,
        math.nan,
        math.nan,
        NOT_KNOWN_INT16,
        winch.status,
    )
