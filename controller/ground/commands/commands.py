"""Commands, by COMMAND_LONG and COMMAND_INT alike: one acknowledgement each, a reason with every refusal."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.commands import flight_commands as fly
from controller.ground.commands import service_commands as serve
from controller.ground.commands.command import WITH_PLACE, Command, Handler, Requests
from controller.ground.commands.result import UNSUPPORTED, UNSUPPORTED_FRAME, Verdict
from controller.ground.flight.modes import Machine
from controller.ground.flight.px4_modes import Mode
from controller.ground.link.packing import ProtocolVersion
from controller.ground.missions.item_types import POINTING
from sitl_bridge.ids import COMPONENT_LOAD, COMPONENT_WINCH

_HANDLERS: dict[int, Handler] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: fly.arm,
    mavlink.MAV_CMD_NAV_TAKEOFF: fly.takeoff,
    mavlink.MAV_CMD_NAV_LAND: fly.mode(Mode.LAND),
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: fly.mode(Mode.RTL),
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: fly.mode(Mode.HOLD),
    mavlink.MAV_CMD_DO_SET_MODE: fly.set_mode,
    mavlink.MAV_CMD_DO_SET_STANDARD_MODE: fly.set_standard_mode,
    mavlink.MAV_CMD_DO_REPOSITION: fly.reposition,
    mavlink.MAV_CMD_DO_CHANGE_ALTITUDE: fly.change_altitude,
    mavlink.MAV_CMD_DO_ORBIT: fly.orbit,
    mavlink.MAV_CMD_DO_FIGURE_EIGHT: fly.figure_eight,
    mavlink.MAV_CMD_DO_GRIPPER: fly.gripper,
    mavlink.MAV_CMD_DO_WINCH: fly.winch,
    mavlink.MAV_CMD_DO_PAUSE_CONTINUE: fly.pause,
    mavlink.MAV_CMD_DO_CHANGE_SPEED: fly.change_speed,
    mavlink.MAV_CMD_MISSION_START: fly.mission_start,
    mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: fly.set_item,
    mavlink.MAV_CMD_DO_SET_HOME: fly.set_home,
    mavlink.MAV_CMD_DO_LAND_START: fly.land_start,
    mavlink.MAV_CMD_DO_GO_AROUND: fly.go_around,
    **dict.fromkeys(POINTING, fly.region_of_interest),
    mavlink.MAV_CMD_DO_FLIGHTTERMINATION: fly.terminate,
    mavlink.MAV_CMD_RUN_PREARM_CHECKS: serve.prearm,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: serve.interval,
    mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: serve.get_interval,
    mavlink.MAV_CMD_REQUEST_MESSAGE: serve.message(),
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: serve.message(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION),
    mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION: serve.message(ProtocolVersion.id),
    mavlink.MAV_CMD_REQUEST_FLIGHT_INFORMATION: serve.message(mavlink.MAVLINK_MSG_ID_FLIGHT_INFORMATION),
    mavlink.MAV_CMD_GET_HOME_POSITION: serve.message(mavlink.MAVLINK_MSG_ID_HOME_POSITION),
    mavlink.MAV_CMD_DO_SET_ACTUATOR: serve.set_actuator,
    mavlink.MAV_CMD_PREFLIGHT_STORAGE: serve.storage,
    mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: serve.reboot,
    mavlink.MAV_CMD_PREFLIGHT_CALIBRATION: serve.calibrate,
    mavlink.MAV_CMD_FIXED_MAG_CAL_YAW: serve.calibrate_magnetometer,
    mavlink.MAV_CMD_INJECT_FAILURE: serve.inject_failure,
}
_ONLY = {COMPONENT_LOAD: mavlink.MAV_CMD_DO_REPOSITION, COMPONENT_WINCH: mavlink.MAV_CMD_DO_WINCH}
"""The one command that load or winch take"""


def execute(command: Command, machine: Machine, requests: Requests, now: float) -> Verdict | None:
    """Carry a command out, or say why not; None: the verdict comes later."""
    handler = _HANDLERS.get(command.number)
    if handler is None:
        entry = mavlink.enums["MAV_CMD"].get(command.number)
        name = entry.name.removeprefix("MAV_CMD_") if entry else "unknown"
        return Verdict(UNSUPPORTED, f"Command {command.number} ({name}) is not supported")
    if command.component in _ONLY and command.number != _ONLY[command.component]:
        name = "load" if command.component == COMPONENT_LOAD else "winch"
        return Verdict(UNSUPPORTED, f"Command {command.number} is not the {name}'s; address the vehicle")
    placed = command.number in WITH_PLACE and any(not math.isnan(p) for p in command[5:8])
    if placed and command.frame_fault:
        return Verdict(UNSUPPORTED_FRAME, f"Command denied: {command.frame_fault}")
    return handler(command, machine, requests, now)
