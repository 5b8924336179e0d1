"""HEARTBEAT: who the vehicle is, whether it is armed, in which mode, and how it is."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.modes import Machine
from controller.ground.flight.px4_modes import BY_STICKS, Mode

_ALWAYS = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
_AUTO = mavlink.MAV_MODE_FLAG_AUTO_ENABLED | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
_STICKS = mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
_OFFBOARD = mavlink.MAV_MODE_FLAG_GUIDED_ENABLED


def base_mode(machine: Machine) -> int:
    """HEARTBEAT.base_mode."""
    flags = _STICKS if machine.mode in BY_STICKS else _OFFBOARD if machine.mode is Mode.OFFBOARD else _AUTO
    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if machine.armed else 0
    return int(_ALWAYS | flags | armed)


def system_status(machine: Machine) -> int:
    """HEARTBEAT.system_status."""
    if machine.terminated:
        return int(mavlink.MAV_STATE_FLIGHT_TERMINATION)
    if machine.view is None:
        return int(mavlink.MAV_STATE_BOOT)
    if not machine.armed:
        return int(mavlink.MAV_STATE_STANDBY)
    active = machine.failsafes.active
    if active & {"battery emergency", "flight"}:
        return int(mavlink.MAV_STATE_EMERGENCY)
    return int(mavlink.MAV_STATE_CRITICAL if active else mavlink.MAV_STATE_ACTIVE)


def heartbeat(machine: Machine) -> Any:
    """The vehicle's HEARTBEAT: a PX4-type quadrotor, as ground stations know what to do with it."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_QUADROTOR,
        mavlink.MAV_AUTOPILOT_PX4,
        base_mode(machine),
        machine.mode.custom_mode,
        system_status(machine),
        3,
    )
