"""What differs on the wire from PX4 to ArduCopter: modes, take-off, who streams what.

PX4: measured on PX4 SITL. ArduCopter: after its documentation; not tried on a real one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pymavlink.dialects.v20 import common as mavlink

from controller.over.stack import AttitudeGains

_CUSTOM = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED


class ModeNumbers(NamedTuple):
    """Parameters 2 and 3 of DO_SET_MODE, and HEARTBEAT.custom_mode."""

    main: int
    sub: int
    custom: int


def _px4(main: int, sub: int) -> ModeNumbers:
    return ModeNumbers(main, sub, main << 16 | sub << 24)


def _arducopter(number: int) -> ModeNumbers:
    return ModeNumbers(number, 0, number)


class Dialect(NamedTuple):
    """One stack's conventions."""

    name: str
    offboard: ModeNumbers
    """The mode that takes attitude and rate set-points."""
    hold: ModeNumbers
    """The stack holds the vehicle by itself."""
    land: ModeNumbers
    takeoff_mode: ModeNumbers | None
    """The mode to be in before arming and take-off; None: the take-off command sets it."""
    relative_takeoff: bool
    """Whether NAV_TAKEOFF's altitude is above home, not above the sea."""
    thrust_parameter: str | None
    """Parameter with the curve from set-point to force, as in `Stack`."""
    holds: tuple[str, int] | None
    """Parameter, and the value with which the stack holds when no set-points come any more."""
    thrust_curve: float
    """That curve where no parameter says it."""
    options: tuple[str, int, str] | None
    """Parameter, bits that have to be set in it before thrust is taken for thrust, and what it means else."""
    patience_parameter: str | None
    """Parameter that says for how many seconds the last set-point is flown when no more come."""
    attitude_parameters: tuple[str, str]
    """Parameters with the gains of the attitude loop, tilt and yaw."""
    attitude_gains: AttitudeGains
    """Those gains where no parameter says them: the defaults of these."""


PX4 = Dialect(
    name="PX4",
    offboard=_px4(6, 0),
    hold=_px4(4, 3),
    land=_px4(4, 6),
    takeoff_mode=None,
    relative_takeoff=False,
    thrust_parameter="THR_MDL_FAC",
    holds=("COM_OBL_RC_ACT", 5),
    thrust_curve=0.0,
    options=None,
    patience_parameter="COM_OF_LOSS_T",
    attitude_parameters=("MC_ROLL_P", "MC_YAW_P"),
    attitude_gains=AttitudeGains(6.5, 2.8),
)
ARDUCOPTER = Dialect(
    name="ArduCopter",
    offboard=_arducopter(4),  # GUIDED
    hold=_arducopter(17),  # BRAKE: LOITER needs a remote control
    land=_arducopter(9),
    takeoff_mode=_arducopter(4),
    relative_takeoff=True,
    thrust_parameter=None,  # it linearises its motors itself, by MOT_THST_EXPO
    holds=None,
    thrust_curve=1.0,
    options=("GUID_OPTIONS", 8, "thrust of a set-point is a climb rate"),
    patience_parameter="GUID_TIMEOUT",
    attitude_parameters=("ATC_ANG_RLL_P", "ATC_ANG_YAW_P"),
    attitude_gains=AttitudeGains(4.5, 4.5),
)
DIALECTS = {"px4": PX4, "ardupilot": ARDUCOPTER}
_BY_AUTOPILOT = {mavlink.MAV_AUTOPILOT_PX4: PX4, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: ARDUCOPTER}


def dialect_of(autopilot: int, otherwise: Dialect) -> Dialect:
    """By what the stack's HEARTBEAT says it is."""
    return _BY_AUTOPILOT.get(autopilot, otherwise)


def set_mode(system: int, numbers: ModeNumbers) -> mavlink.MAVLink_command_long_message:
    """DO_SET_MODE."""
    parameters = (float(_CUSTOM), float(numbers.main), float(numbers.sub), 0.0, 0.0, 0.0, 0.0)
    return command(system, mavlink.MAV_CMD_DO_SET_MODE, *parameters)


def arm(system: int) -> mavlink.MAVLink_command_long_message:
    """COMPONENT_ARM_DISARM, to arm."""
    return command(system, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def take_off(system: int, altitude: float) -> mavlink.MAVLink_command_long_message:
    """NAV_TAKEOFF where the vehicle stands; altitude in m, above what the dialect says."""
    nan = math.nan
    return command(system, mavlink.MAV_CMD_NAV_TAKEOFF, nan, 0.0, 0.0, nan, nan, nan, altitude)


def message_interval(system: int, message_id: int, rate_hz: float) -> mavlink.MAVLink_command_long_message:
    """SET_MESSAGE_INTERVAL."""
    interval = 1e6 / rate_hz
    return command(
        system, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, float(message_id), interval, 0.0, 0.0, 0.0, 0.0, 0.0
    )


def request_message(system: int, message_id: int) -> mavlink.MAVLink_command_long_message:
    """REQUEST_MESSAGE: once."""
    number = mavlink.MAV_CMD_REQUEST_MESSAGE
    return command(system, number, float(message_id), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def command_name(number: int) -> str:
    """A MAV_CMD as MAVLink's documentation has it."""
    names = mavlink.enums["MAV_CMD"]
    return names[number].name.removeprefix("MAV_CMD_") if number in names else f"command {number}"


def command(system: int, number: int, *parameters: float) -> mavlink.MAVLink_command_long_message:
    """COMMAND_LONG to the stack's autopilot."""
    return mavlink.MAVLink_command_long_message(
        system, mavlink.MAV_COMP_ID_AUTOPILOT1, number, 0, *parameters
    )
