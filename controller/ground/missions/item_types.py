"""Which mission commands there are here, and what kind each is of."""

from __future__ import annotations

from pymavlink.dialects.v20 import common as mavlink

WAYPOINT: int = mavlink.MAV_CMD_NAV_WAYPOINT
LOITER: int = mavlink.MAV_CMD_NAV_LOITER_UNLIM
LOITER_TIME: int = mavlink.MAV_CMD_NAV_LOITER_TIME
LOITER_TO_ALT: int = mavlink.MAV_CMD_NAV_LOITER_TO_ALT
RETURN: int = mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
LAND: int = mavlink.MAV_CMD_NAV_LAND
TAKEOFF: int = mavlink.MAV_CMD_NAV_TAKEOFF
PAYLOAD_PLACE: int = mavlink.MAV_CMD_NAV_PAYLOAD_PLACE
DELAY: int = mavlink.MAV_CMD_NAV_DELAY
CONDITION_DELAY: int = mavlink.MAV_CMD_CONDITION_DELAY
CONDITION_DISTANCE: int = mavlink.MAV_CMD_CONDITION_DISTANCE
GRIPPER: int = mavlink.MAV_CMD_DO_GRIPPER
WINCH: int = mavlink.MAV_CMD_DO_WINCH
JUMP: int = mavlink.MAV_CMD_DO_JUMP
CHANGE_SPEED: int = mavlink.MAV_CMD_DO_CHANGE_SPEED
SET_HOME: int = mavlink.MAV_CMD_DO_SET_HOME
ROI = (mavlink.MAV_CMD_DO_SET_ROI, mavlink.MAV_CMD_NAV_ROI)
"""One command, by its present and its old number"""
ROI_LOCATION: int = mavlink.MAV_CMD_DO_SET_ROI_LOCATION
ROI_NEXT: int = mavlink.MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET
ROI_NONE: int = mavlink.MAV_CMD_DO_SET_ROI_NONE

WITH_POSITION = (WAYPOINT, LOITER, LOITER_TIME, LOITER_TO_ALT, TAKEOFF, LAND, PAYLOAD_PLACE)
"""The vehicle goes there"""
_ZONES = (5000, 5001, 5002, 5003, 5004, 5100)
"""Fence and rally items, MAV_CMD_NAV_FENCE_RETURN_POINT to NAV_RALLY_POINT"""
WITH_PLACE = (*WITH_POSITION, SET_HOME, *ROI, ROI_LOCATION, mavlink.MAV_CMD_CONDITION_GATE, *_ZONES)
"""x and y are degrees times 1e7"""
DELAYS = (DELAY, CONDITION_DELAY)
POINTING = (*ROI, ROI_LOCATION, ROI_NEXT, ROI_NONE)

_CAMERA = (
    mavlink.MAV_CMD_DO_CONTROL_VIDEO,
    mavlink.MAV_CMD_DO_DIGICAM_CONFIGURE,
    mavlink.MAV_CMD_DO_DIGICAM_CONTROL,
    mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
    mavlink.MAV_CMD_DO_SET_CAM_TRIGG_INTERVAL,
    mavlink.MAV_CMD_DO_TRIGGER_CONTROL,
    mavlink.MAV_CMD_IMAGE_START_CAPTURE,
    mavlink.MAV_CMD_IMAGE_STOP_CAPTURE,
    mavlink.MAV_CMD_VIDEO_START_CAPTURE,
    mavlink.MAV_CMD_VIDEO_STOP_CAPTURE,
    mavlink.MAV_CMD_SET_CAMERA_MODE,
    mavlink.MAV_CMD_SET_CAMERA_SOURCE,
    mavlink.MAV_CMD_SET_CAMERA_ZOOM,
    mavlink.MAV_CMD_SET_CAMERA_FOCUS,
    mavlink.MAV_CMD_OBLIQUE_SURVEY,
)
_GIMBAL = (
    mavlink.MAV_CMD_DO_MOUNT_CONFIGURE,
    mavlink.MAV_CMD_DO_MOUNT_CONTROL,
    mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
    mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE,
)
_OUTPUTS = (
    mavlink.MAV_CMD_DO_SET_SERVO,
    mavlink.MAV_CMD_DO_REPEAT_SERVO,
    mavlink.MAV_CMD_DO_SET_RELAY,
    mavlink.MAV_CMD_DO_REPEAT_RELAY,
    mavlink.MAV_CMD_DO_SET_ACTUATOR,
)
WITHOUT_EFFECT: dict[int, str] = {
    **dict.fromkeys(_CAMERA, "camera"),
    **dict.fromkeys(_GIMBAL, "gimbal"),
    **dict.fromkeys(_OUTPUTS, "servo"),
    GRIPPER: "gripper",
    WINCH: "winch",
}
"""Commands for hardware that is not there, with its name"""
_MARKS = (
    mavlink.MAV_CMD_DO_LAND_START,
    CONDITION_DISTANCE,
    mavlink.MAV_CMD_CONDITION_GATE,
)
"""What they hold back has no effect here, or they only mark a place in the plan"""
SUPPORTED = frozenset(
    (*WITH_POSITION, RETURN, *DELAYS, JUMP, CHANGE_SPEED, SET_HOME, *POINTING, *WITHOUT_EFFECT, *_MARKS)
)
