"""Let the load fly a figure eight with pymavlink: python examples/load_figure_eight.py [udpin:…]

The load has a MAVLink system of its own, 100 above the vehicle's: set-points that are addressed to it say
where the load is to be. Position, velocity and acceleration together make it follow without a lag.
"""

import math
import sys
import time

from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mavlink

RATE = 20.0  # Hz
SIZE, PERIOD, HEIGHT, LAPS = 3.0, 15.0, 3.0, 2  # m, s, m above the start, laps
PX4_LAND, PX4_OFFBOARD = (4, 6), (6, 0)


def eight(t: float) -> tuple[list[float], list[float], list[float]]:
    """Position, velocity, acceleration (NED) on SIZE·(sin wt, sin 2wt / 2), at time t (s)."""
    w = 2.0 * math.pi / PERIOD
    north, east = SIZE * math.sin(w * t), 0.5 * SIZE * math.sin(2 * w * t)
    return (
        [north, east, -HEIGHT],
        [SIZE * w * math.cos(w * t), SIZE * w * math.cos(2 * w * t), 0.0],
        [-w * w * north, -4.0 * w * w * east, 0.0],
    )


def main(connection: str) -> None:
    link = mavutil.mavlink_connection(connection, source_system=245, source_component=190)
    link.wait_heartbeat()
    vehicle, load = 1, 101

    def command(number: int, *parameters: float) -> None:
        values = [*parameters, *[math.nan] * (7 - len(parameters))]
        link.mav.command_long_send(vehicle, 1, number, 0, *values)
        while (ack := link.recv_match(type="COMMAND_ACK", blocking=True, timeout=5)) is not None:
            if ack.command == number:
                break
        if ack is None or ack.result != mavlink.MAV_RESULT_ACCEPTED:
            said = link.messages.get("STATUSTEXT")
            sys.exit(f"command {number} refused: {said.text if said else ack}")

    def beat() -> None:
        link.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)

    def send(t: float) -> None:
        position, velocity, acceleration = eight(max(0.0, t))
        if t < 0.0:  # not yet: wait where it begins
            velocity = acceleration = [math.nan] * 3
        frame = mavlink.MAV_FRAME_LOCAL_NED
        mask = mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE | mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
        link.mav.set_position_target_local_ned_send(
            0, load, 35, frame, mask, *position, *velocity, *acceleration, 0.0, 0.0
        )

    beat()
    while link.recv_match(type="SYS_STATUS", blocking=True) is None:
        pass
    command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    send(-1.0)
    command(mavlink.MAV_CMD_DO_SET_MODE, 1.0, *PX4_OFFBOARD)  # takes off by itself
    began = time.monotonic()
    airborne = None
    while airborne is None or time.monotonic() - airborne < LAPS * PERIOD:
        send(-1.0 if airborne is None else time.monotonic() - airborne)
        beat()
        while (message := link.recv_match(blocking=False)) is not None:
            if message.get_type() == "EXTENDED_SYS_STATE" and airborne is None:
                high = link.messages.get("LOCAL_POSITION_NED")
                if high is not None and -high.z > HEIGHT + 1.0:
                    airborne = time.monotonic() + 5.0
                    print("the load is up: figure eight")
        if time.monotonic() - began > 90.0 + LAPS * PERIOD:
            sys.exit("the vehicle did not take off")
        time.sleep(1.0 / RATE)
    command(mavlink.MAV_CMD_DO_SET_MODE, 1.0, *PX4_LAND)
    while link.recv_match(type="HEARTBEAT", blocking=True).base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED:
        beat()
    print("landed")


main(sys.argv[1] if len(sys.argv) > 1 else "udpin:127.0.0.1:14550")
