"""Every parameter of the vehicle: names, ranges, units, meanings and defaults stand here, or in `px4_table`.

PARAM_* answers, the defaults and docs/parameters.md come from here. Names are PX4's where PX4 has the same
thing, so that ground stations show it where people look for it.
"""

# ruff: noqa: E501 (one line for each parameter)

from __future__ import annotations

from controller.ground.parameters.parameter import Parameter
from controller.ground.parameters.px4_table import PX4_TABLE

_LINK_ACTIONS = ((0, "none"), (1, "hold"), (2, "return"), (3, "land"), (5, "terminate"), (6, "disarm"))
_FENCE_ACTIONS = ((0, "none"), (1, "warn"), (2, "hold"), (3, "return"), (4, "terminate"), (5, "land"))
_OFFBOARD_ACTIONS = (
    (0, "position mode, or hold"),
    (1, "altitude mode, or hold"),
    (2, "hold"),
    (3, "return"),
    (4, "land"),
    (5, "hold"),
    (6, "terminate"),
    (7, "disarm"),
)
_BATTERY_ACTIONS = ((0, "warn"), (2, "land when critical"), (3, "return when critical, land in emergency"))
_HIL_ACTIONS = ((0, "go on when it is back"), (1, "hold when it is back"), (4, "terminate"))
_STICKS = (
    (0, "remote control only"),
    (1, "joystick only"),
    (2, "both, with fallback"),
    (3, "both, the first is kept"),
    (4, "none"),
)
_WEIGHT = "Factor on the default weight in the LQR's cost; the gains are designed again in flight. "

_USED: tuple[Parameter, ...] = (
    # Who the vehicle is. QGroundControl's pages read these.
    Parameter("SYS_AUTOSTART", 10016, 1, 99999, "", "Airframe that ground stations show (not 0: they would ask to set it up)"),
    Parameter("COM_RC_IN_MODE", 1, 0, 4, "", "Source of manual control; there is no remote control but a joystick", _STICKS),
    Parameter("RC_MAP_ROLL", 0, 0, 18, "", "Remote-control channel; no effect, read by ground stations"),
    Parameter("RC_MAP_PITCH", 0, 0, 18, "", "Remote-control channel; no effect, read by ground stations"),
    Parameter("RC_MAP_YAW", 0, 0, 18, "", "Remote-control channel; no effect, read by ground stations"),
    Parameter("RC_MAP_THROTTLE", 0, 0, 18, "", "Remote-control channel; no effect, read by ground stations"),
    Parameter("CAL_GYRO0_ID", 1310988, 1, 2147483647, "", "Gyroscope that is calibrated (not 0); no effect"),
    Parameter("CAL_ACC0_ID", 1310988, 1, 2147483647, "", "Accelerometer that is calibrated (not 0); no effect"),
    Parameter("CAL_MAG0_ID", 197388, 1, 2147483647, "", "Magnetometer that is calibrated (not 0); no effect"),
    Parameter("SYS_FAILURE_EN", 0, 0, 1, "", "Whether MAV_CMD_INJECT_FAILURE is passed on to the plant", ((0, "refused"), (1, "passed on"))),
    Parameter("BAT1_N_CELLS", 4, 1, 100, "", "Cells in series, by default the vehicle's if it has a battery; BATTERY_STATUS shares the voltage among them"),
    Parameter("BAT1_V_CHARGED", 4.05, 3.0, 4.5, "V", "Voltage of a full cell; no effect, read by ground stations"),
    Parameter("BAT1_V_EMPTY", 3.6, 2.5, 4.0, "V", "Voltage of an empty cell under load; no effect, read by ground stations"),
    # Take-off, flight, landing
    Parameter("MIS_TAKEOFF_ALT", 2.5, 0.5, 80.0, "m", "Height of the vehicle above home after take-off; more where the load would not leave the ground"),
    Parameter("MPC_TKO_SPEED", 1.0, 0.2, 5.0, "m/s", "Climb rate of a take-off"),
    Parameter("MPC_LAND_SPEED", 0.5, 0.1, 2.0, "m/s", "Sink rate when load or vehicle touch down"),
    Parameter("MPC_XY_CRUISE", 3.0, 0.1, 20.0, "m/s", "Largest horizontal speed to a point, in missions and on the way back"),
    Parameter("MPC_XY_VEL_MAX", 6.0, 0.1, 20.0, "m/s", "Largest horizontal speed of any set-point: faster ones are limited"),
    Parameter("MPC_Z_VEL_MAX_UP", 2.0, 0.1, 8.0, "m/s", "Largest climb rate of any set-point"),
    Parameter("MPC_Z_VEL_MAX_DN", 1.5, 0.1, 8.0, "m/s", "Largest sink rate of any set-point"),
    Parameter("MPC_ACC_HOR", 2.0, 0.2, 10.0, "m/s^2", "Acceleration with which the vehicle comes to a hold"),
    Parameter("MPC_ACC_HOR_MAX", 4.0, 0.5, 15.0, "m/s^2", "Largest acceleration on a trajectory of set-points, and never more than the rotors can give: larger ones are limited"),
    Parameter("NAV_ACC_RAD", 1.0, 0.05, 200.0, "m", "Radius in which vehicle and load have to be for a way-point to count as reached"),
    Parameter("LND_CLEARANCE", 0.5, 0.1, 20.0, "m", "Least height of the hanging load above home's ground; lower set-points are raised to it"),
    Parameter("LND_BESIDE", 0.8, 0.2, 20.0, "m", "Distance from the load at which the vehicle lands; at most 0.6 of the cable"),
    # Attitude set-points (SET_ATTITUDE_TARGET)
    Parameter("MPC_THR_HOVER", 0.5, 0.1, 0.8, "", "Thrust of a set-point that carries vehicle and load; by default the vehicle's own, with 1 all that its rotors can give"),
    Parameter("MC_ROLL_P", 6.5, 0.0, 12.0, "1/s", "Roll rate per error of the roll; at most what the rotors' lag bears"),
    Parameter("MC_PITCH_P", 6.5, 0.0, 12.0, "1/s", "Pitch rate per error of the pitch; at most what the rotors' lag bears"),
    Parameter("MC_YAW_P", 2.8, 0.0, 5.0, "1/s", "Yaw rate per error of the heading; at most what the rotors' lag bears"),
    Parameter("MC_ROLLRATE_MAX", 220.0, 0.0, 1800.0, "deg/s", "Largest roll rate that an attitude may ask for"),
    Parameter("MC_PITCHRATE_MAX", 220.0, 0.0, 1800.0, "deg/s", "Largest pitch rate that an attitude may ask for"),
    Parameter("MC_YAWRATE_MAX", 200.0, 0.0, 1800.0, "deg/s", "Largest yaw rate that an attitude may ask for"),
    # Sticks (MANUAL_CONTROL)
    Parameter("MPC_VEL_MANUAL", 10.0, 3.0, 20.0, "m/s", "Largest horizontal speed by sticks; at most MPC_XY_VEL_MAX"),
    Parameter("MPC_MAN_Y_MAX", 150.0, 0.0, 400.0, "deg/s", "Largest yaw rate by sticks; more than the vehicle turns is limited"),
    Parameter("MPC_MAN_TILT_MAX", 35.0, 0.0, 90.0, "deg", "Largest tilt by sticks in Altitude mode; never more acceleration than MPC_ACC_HOR"),
    Parameter("MPC_HOLD_DZ", 0.1, 0.0, 1.0, "", "Dead zone in the middle of a stick"),
    Parameter("MPC_XY_MAN_EXPO", 0.6, 0.0, 1.0, "", "Share of the cube in the curve of the horizontal sticks"),
    Parameter("MPC_Z_MAN_EXPO", 0.6, 0.0, 1.0, "", "Share of the cube in the curve of the throttle"),
    Parameter("MPC_YAW_EXPO", 0.6, 0.0, 1.0, "", "Share of the cube in the curve of the yaw stick"),
    Parameter("COM_RC_OVERRIDE", 1, 0, 3, "", "In which modes sticks that move take over, as bits: 1 automatic modes, 2 Offboard"),
    Parameter("COM_RC_STICK_OV", 30.0, 5.0, 80.0, "%", "How far a stick has to move to take over"),
    # Follow Me
    Parameter("FLW_TGT_HT", 8.0, 8.0, 1000.0, "m", "Height of the vehicle above home, or above the target (FLW_TGT_ALT_M)"),
    Parameter("FLW_TGT_DST", 8.0, 1.0, 100.0, "m", "Horizontal distance from the target"),
    Parameter("FLW_TGT_FA", 180.0, -180.0, 180.0, "deg", "Side of the target, clockwise from its front: 180 is behind it"),
    Parameter("FLW_TGT_ALT_M", 0, 0, 2, "", "What FLW_TGT_HT counts from", ((0, "home"), (1, "home (no terrain is known)"), (2, "the target"))),
    Parameter("FLW_TGT_MAX_VEL", 5.0, 0.0, 20.0, "m/s", "Largest speed around the target, when it turns"),
    # Return
    Parameter("RTL_RETURN_ALT", 6.0, 1.0, 150.0, "m", "Height above home on the way back"),
    Parameter("RTL_TYPE", 0, 0, 5, "", "Where to return to; 0 or 3: home or a nearer rally point, 1: the nearest rally point, else home"),
    Parameter("RTL_MIN_DIST", 3.0, 0.0, 100.0, "m", "Nearer to home than this, the vehicle does not climb to RTL_RETURN_ALT first"),
    Parameter("RTL_LAND_DELAY", 0.0, -1.0, 300.0, "s", "Wait above home before landing; -1: stay there"),
    # Arming
    Parameter("COM_DISARM_LAND", 2.0, 0.1, 20.0, "s", "Disarm so long after landing"),
    Parameter("COM_DISARM_PRFLT", 10.0, -1.0, 120.0, "s", "Disarm if there is no take-off so long after arming; negative: never"),
    Parameter("COM_ARM_TILT", 20.0, 1.0, 60.0, "deg", "Largest tilt at which the vehicle can be armed"),
    Parameter("COM_ARM_SPEED", 0.5, 0.05, 5.0, "m/s", "Largest speed at which the vehicle counts as at rest and can be armed"),
    Parameter("COM_ARM_BAT_MIN", 0.2, -1.0, 1.0, "", "Least remaining charge (0..1) to arm; negative: no check"),
    # Failsafes; docs/failsafes.md
    Parameter("COM_HIL_LOSS_T", 2.0, 0.05, 30.0, "s", "Without HIL_SENSOR for so long, the link to the plant is lost"),
    Parameter("COM_HIL_LOSS_ACT", 1, 0, 4, "", "Reaction to a lost link to the plant", _HIL_ACTIONS),
    Parameter("COM_OF_LOSS_T", 1.0, 0.05, 60.0, "s", "Without a set-point for so long, offboard control is lost"),
    Parameter("COM_OBL_RC_ACT", 5, 0, 7, "", "Reaction to lost offboard set-points", _OFFBOARD_ACTIONS),
    Parameter("COM_RC_LOSS_T", 0.5, 0.0, 35.0, "s", "Without MANUAL_CONTROL for so long, a pilot's sticks are lost"),
    Parameter("NAV_RCL_ACT", 2, 1, 6, "", "Reaction to lost sticks, if they have been heard since arming", _LINK_ACTIONS[1:]),
    Parameter("COM_RCL_EXCEPT", 0, 0, 31, "", "Modes in which lost sticks are no failure, as bits: 1 Mission, 2 Hold, 4 Offboard"),
    Parameter("COM_DL_LOSS_T", 10.0, 1.0, 300.0, "s", "Without any ground station's HEARTBEAT for so long, all are lost"),
    Parameter("NAV_DLL_ACT", 2, 0, 6, "", "Reaction to the loss of the last ground station, if one has been heard since arming", _LINK_ACTIONS),
    Parameter("COM_LOW_BAT_ACT", 3, 0, 3, "", "Reaction to a low battery", _BATTERY_ACTIONS),
    Parameter("BAT_LOW_THR", 0.15, 0.02, 0.8, "", "Remaining charge (0..1) that is low: a warning"),
    Parameter("BAT_CRIT_THR", 0.07, 0.01, 0.5, "", "Remaining charge (0..1) that is critical"),
    Parameter("BAT_EMERGEN_THR", 0.05, 0.0, 0.4, "", "Remaining charge (0..1) that is an emergency"),
    Parameter("GF_ACTION", 3, 0, 5, "", "Reaction when the vehicle leaves the geofence", _FENCE_ACTIONS),
    Parameter("GF_MAX_HOR_DIST", 0.0, 0.0, 10000.0, "m", "Radius of the geofence around home; 0: none"),
    Parameter("GF_MAX_VER_DIST", 0.0, 0.0, 10000.0, "m", "Height of the geofence above home; 0: none"),
    Parameter("FD_FAIL_TILT", 70.0, 30.0, 180.0, "deg", "Tilt at which the flight has failed and is terminated; 180: never"),
    # The law: factors on the weights of the integral LQR, controller/design/catalogue.py
    Parameter("LQR_Q_VPOS", 1.0, 1e-3, 1e3, "", _WEIGHT + "Position of the vehicle while it carries the load"),
    Parameter("LQR_Q_LPOS", 1.0, 1e-3, 1e3, "", _WEIGHT + "Position of the load (of the vehicle, when it flies alone)"),
    Parameter("LQR_Q_VVEL", 1.0, 1e-3, 1e3, "", _WEIGHT + "Velocity of the vehicle"),
    Parameter("LQR_Q_LVEL", 1.0, 1e-3, 1e3, "", _WEIGHT + "Velocity of the load"),
    Parameter("LQR_Q_RATE", 1.0, 1e-3, 1e3, "", _WEIGHT + "Body rates"),
    Parameter("LQR_Q_ATT", 1.0, 1e-3, 1e3, "", _WEIGHT + "Attitude"),
    Parameter("LQR_Q_INT", 1.0, 1e-3, 1e3, "", _WEIGHT + "Integral of the load's position error"),
    Parameter("LQR_R_THRUST", 1.0, 1e-3, 1e3, "", _WEIGHT + "Thrust"),
    Parameter("LQR_R_MOMENT", 1.0, 1e-3, 1e3, "", _WEIGHT + "Moments"),
)  # fmt: skip

TABLE: tuple[Parameter, ...] = _USED + PX4_TABLE
"""Every parameter, in the order of its index on the wire."""

BY_NAME: dict[str, Parameter] = {parameter.name: parameter for parameter in TABLE}


def _rows(parameters: tuple[Parameter, ...]) -> list[str]:
    return [
        f"| `{p.name}` | {p.shown(p.default)} | {p.range} | {p.unit} | {p.description} |" for p in parameters
    ]


def markdown() -> str:
    """docs/parameters.md."""
    lines = [
        "# Parameters",
        "",
        "Made from `controller/ground/parameters/table.py` (`python -m controller.ground.parameters.table`); do not edit.",
        "",
        "Change them with any ground station. They last until the controller stops, unless they are stored",
        "(MAV_CMD_PREFLIGHT_STORAGE, `--parameters FILE`).",
        "",
        "| name | default | range | unit | meaning |",
        "|---|---|---|---|---|",
    ]
    lines += _rows(_USED)
    lines += [
        "",
        "## Kept, without effect",
        "",
        "PX4's parameters that scripts set and that have nothing to act on here: a value in range is kept and given back,",
        "and changes nothing about the flight.",
        "",
        "| name | default | range | unit | what it is on PX4 |",
        "|---|---|---|---|---|",
    ]
    lines += _rows(PX4_TABLE)
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(markdown(), end="")
