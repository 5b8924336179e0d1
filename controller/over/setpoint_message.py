"""SET_ATTITUDE_TARGET from what the law wants."""

from __future__ import annotations

from pymavlink.dialects.v20 import common as mavlink

from controller.over.law import Setpoint
from sitl_bridge.frames import attitude_to_ned_frd, flu_to_frd, quaternion_from_euler

RATES_ONLY = mavlink.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
ATTITUDE_ONLY = (
    mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE
    | mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE
    | mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE
)


def attitude_target(
    wanted: Setpoint, thrust: float, milliseconds: int, system: int
) -> mavlink.MAVLink_set_attitude_target_message:
    """Body rates or the attitude, and the thrust, 0 to 1; milliseconds: of the stack's clock."""
    if wanted.attitude is None:
        mask, quaternion, rates = RATES_ONLY, (1.0, 0.0, 0.0, 0.0), flu_to_frd(wanted.rates)
    else:
        mask, rates = ATTITUDE_ONLY, (0.0, 0.0, 0.0)
        quaternion = attitude_to_ned_frd(quaternion_from_euler(wanted.attitude))
    return mavlink.MAVLink_set_attitude_target_message(
        milliseconds, system, 1, mask, list(quaternion), *rates, thrust
    )
