"""Messages about where the vehicle is, how it moves, and what it flies to."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.commands.setpoints import NOTHING
from controller.ground.flight.guidance import Stage
from controller.ground.flight.modes import Machine
from controller.ground.flight.motion.geometry import filled
from controller.ground.flight.motion.patterns import FigureEight, Orbit
from controller.ground.flight.motion.setpoint_types import Attitude, Body, Follow, Goto, Land
from controller.ground.link.packing import (
    FigureEightStatus,
)
from controller.ground.telemetry.units import (
    above_home,
    heading,
    in_body,
    microseconds,
    milliseconds,
    place,
    rates,
)
from controller.ground.telemetry.vehicle_state import VehicleView
from sitl_bridge.frames import (
    CENTIDEGREES_PER_RADIAN,
    CENTIMETRES_PER_METRE,
    MILLIMETRES_PER_METRE,
    PERCENT,
    attitude_to_ned_frd,
    enu_to_ned,
    euler_from_quaternion,
    flu_to_frd,
    heading_from_yaw,
)
from sitl_bridge.mavlink.fields import (
    whole,
)


def attitude(machine: Machine, view: VehicleView) -> Any:
    """ATTITUDE."""
    euler = euler_from_quaternion(attitude_to_ned_frd(view.attitude))
    return mavlink.MAVLink_attitude_message(milliseconds(view), *euler, *rates(view))


def attitude_quaternion(machine: Machine, view: VehicleView) -> Any:
    """ATTITUDE_QUATERNION."""
    q = attitude_to_ned_frd(view.attitude)
    return mavlink.MAVLink_attitude_quaternion_message(milliseconds(view), *q, *rates(view))


def local_position(machine: Machine, view: VehicleView) -> Any:
    """LOCAL_POSITION_NED."""
    position, velocity = enu_to_ned(view.position), enu_to_ned(view.velocity)
    return mavlink.MAVLink_local_position_ned_message(milliseconds(view), *position, *velocity)


def global_position(machine: Machine, view: VehicleView) -> Any:
    """GLOBAL_POSITION_INT."""
    velocity = (whole(v * CENTIMETRES_PER_METRE, 16) for v in enu_to_ned(view.velocity))
    return mavlink.MAVLink_global_position_int_message(
        milliseconds(view),
        *place(machine, view.position),
        whole(above_home(machine, view.position[2]) * MILLIMETRES_PER_METRE, 32),
        *velocity,
        whole(heading(view) * CENTIDEGREES_PER_RADIAN, 16, signed=False) % 36000,
    )


def vfr_hud(machine: Machine, view: VehicleView) -> Any:
    """VFR_HUD."""
    speed = math.hypot(view.velocity[0], view.velocity[1])
    return mavlink.MAVLink_vfr_hud_message(
        math.hypot(*view.velocity),
        speed,
        whole(math.degrees(heading(view)), 16) % 360,
        whole(view.throttle * PERCENT, 16, signed=False),
        machine.profile.origin.home.altitude + view.position[2],
        view.velocity[2],
    )


def altitude(machine: Machine, view: VehicleView) -> Any:
    """ALTITUDE."""
    height = view.position[2]
    amsl = machine.profile.origin.home.altitude + height
    above = above_home(machine, height)
    clearance = above if machine.profile.has_ground else math.nan
    return mavlink.MAVLink_altitude_message(
        microseconds(view), amsl, amsl, height, above, math.nan, clearance
    )


def home_position(machine: Machine, view: VehicleView) -> Any:
    """HOME_POSITION."""
    if machine.home is None:
        return None
    approach = (math.nan, math.nan, math.nan)
    return mavlink.MAVLink_home_position_message(
        *place(machine, machine.home),
        *enu_to_ned(machine.home),
        (1.0, 0.0, 0.0, 0.0),
        *approach,
        microseconds(view),
    )


def position_target(machine: Machine, view: VehicleView) -> Any:
    """POSITION_TARGET_LOCAL_NED."""
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
        milliseconds(view), mavlink.MAV_FRAME_LOCAL_NED, mask, *fields, heading, -rate
    )


def position_target_global(machine: Machine, view: VehicleView) -> Any:
    """POSITION_TARGET_GLOBAL_INT: the local target, its place in degrees above mean sea level."""
    local = position_target(machine, view)
    if local is None:
        return None
    at = enu_to_ned((local.x, local.y, local.z))  # its own inverse
    x, y, altitude = place(machine, filled(at, view.position))
    height = math.nan if math.isnan(at[2]) else altitude / MILLIMETRES_PER_METRE
    rates = (local.vx, local.vy, local.vz, local.afx, local.afy, local.afz, local.yaw, local.yaw_rate)
    return mavlink.MAVLink_position_target_global_int_message(
        milliseconds(view), mavlink.MAV_FRAME_GLOBAL_INT, local.type_mask, x, y, height, *rates
    )


def attitude_target(machine: Machine, view: VehicleView) -> Any:
    """ATTITUDE_TARGET: what a client asks for; other targets have positions."""
    target = machine.target
    if not isinstance(target, Attitude):
        return None
    rates = flu_to_frd(target.body_rates)
    mask = sum(1 << bit for bit, rate in enumerate(rates) if math.isnan(rate))
    mask |= (1 << 7) * (target.attitude is None)
    q = attitude_to_ned_frd(view.attitude if target.attitude is None else target.attitude)
    return mavlink.MAVLink_attitude_target_message(milliseconds(view), mask, q, *rates, target.thrust)


def odometry(machine: Machine, view: VehicleView) -> Any:
    """ODOMETRY."""
    from_world = flu_to_frd(in_body(view))
    unknown = [math.nan] * 21
    return mavlink.MAVLink_odometry_message(
        microseconds(view),
        mavlink.MAV_FRAME_LOCAL_NED,
        mavlink.MAV_FRAME_BODY_FRD,
        *enu_to_ned(view.position),
        attitude_to_ned_frd(view.attitude),
        *from_world,
        *rates(view),
        unknown,
        unknown,
        0,
        mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT,
        100 if view.health.position else 0,
    )


def highres_imu(machine: Machine, view: VehicleView) -> Any:
    """HIGHRES_IMU."""
    missing = (0.0,) * 7
    return mavlink.MAVLink_highres_imu_message(
        microseconds(view), *flu_to_frd(view.acceleration), *rates(view), *missing, 0x3F
    )


def orbit_status(machine: Machine, view: VehicleView) -> Any:
    """ORBIT_EXECUTION_STATUS."""
    orbit = machine.pattern
    if not isinstance(orbit, Orbit) or machine.stage is not Stage.FLYING:
        return None
    x, y, altitude = place(machine, orbit.centre)
    return mavlink.MAVLink_orbit_execution_status_message(
        microseconds(view),
        -orbit.sense * orbit.radius,
        mavlink.MAV_FRAME_GLOBAL_INT,
        x,
        y,
        altitude / MILLIMETRES_PER_METRE,
    )


def figure_eight_status(machine: Machine, view: VehicleView) -> Any:
    """FIGURE_EIGHT_EXECUTION_STATUS."""
    figure = machine.pattern
    if not isinstance(figure, FigureEight) or machine.stage is not Stage.FLYING:
        return None
    x, y, altitude = place(machine, figure.centre)
    where = (x, y, altitude / MILLIMETRES_PER_METRE)
    frame, axis = mavlink.MAV_FRAME_GLOBAL_INT, heading_from_yaw(figure.axis)
    return FigureEightStatus(
        microseconds(view), figure.sense * figure.major, figure.minor, axis, frame, where
    )
