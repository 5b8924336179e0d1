"""Let the load fly a figure eight, offboard, with pymavlink: python examples/figure_eight.py [udpin:…]

The load has a MAVLink system of its own, 100 above the vehicle's: set-points that are addressed to it say
where the load is to be. Position, velocity and acceleration together make it follow without a lag.
"""

import math
import sys
from typing import Any

from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mavlink

SIZE, PERIOD, HEIGHT, LAPS = 3.0, 15.0, 3.0, 1  # m, s, m above the start, laps
RETURN, OFFBOARD = (4, 5), (6, 0)  # PX4's modes
VEHICLE, LOAD = 1, 101  # MAVLink systems
NO_YAW = mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE | mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE


def eight(t: float) -> list[float]:
    """North, east, down (m), their velocities and accelerations at time t (s)."""
    w = 2.0 * math.pi / PERIOD
    north, east = SIZE * math.sin(w * t), 0.5 * SIZE * math.sin(2.0 * w * t)
    velocity = [SIZE * w * math.cos(w * t), SIZE * w * math.cos(2.0 * w * t), 0.0]
    return [north, east, -HEIGHT, *velocity, -w * w * north, -4.0 * w * w * east, 0.0]


class Link:
    """A connection to the vehicle, as a ground station."""

    def __init__(self, connection: str) -> None:
        self.link = mavutil.mavlink_connection(connection, source_system=245, source_component=190)

    def wait_for(self, kind: str, system: int = VEHICLE) -> Any:
        """The next message of a type; what the vehicle has to say is printed meanwhile."""
        while True:
            message = self.link.recv_match(type=[kind, "HEARTBEAT", "STATUSTEXT"], blocking=True, timeout=10)
            if message is None:
                sys.exit("no vehicle: start one with `sitl fly hold`")
            if message.get_type() == "HEARTBEAT":  # as often as the vehicle's and the load's: enough
                self.link.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)
            if message.get_type() == "STATUSTEXT":
                print(message.text)
            if message.get_type() == kind and message.get_srcSystem() == system:
                return message

    def command(self, number: int, *parameters: float) -> None:
        """Send a command; ends the script if it is refused."""
        unset = [math.nan] * (7 - len(parameters))
        self.link.mav.command_long_send(VEHICLE, 1, number, 0, *parameters, *unset)
        if (ack := self.wait_for("COMMAND_ACK")).result != mavlink.MAV_RESULT_ACCEPTED:
            sys.exit(f"command {number} refused: {ack}")

    def send_load_to(self, numbers: list[float]) -> None:
        """A set-point for the load: position, velocity, acceleration."""
        frame = mavlink.MAV_FRAME_LOCAL_NED
        self.link.mav.set_position_target_local_ned_send(0, LOAD, 35, frame, NO_YAW, *numbers, 0.0, 0.0)


def main(connection: str) -> None:
    vehicle = Link(connection)
    while (
        not vehicle.wait_for("SYS_STATUS").onboard_control_sensors_health
        & mavlink.MAV_SYS_STATUS_PREARM_CHECK
    ):
        pass
    vehicle.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 50_000)
    vehicle.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    vehicle.command(mavlink.MAV_CMD_NAV_TAKEOFF)
    while vehicle.wait_for("EXTENDED_SYS_STATE").landed_state != mavlink.MAV_LANDED_STATE_IN_AIR:
        pass
    # The vehicle's own clock times the set-points, 20 a second: right even if the simulation is slow.
    began = vehicle.wait_for("LOCAL_POSITION_NED").time_boot_ms / 1000.0
    vehicle.send_load_to(eight(0.0))
    vehicle.command(mavlink.MAV_CMD_DO_SET_MODE, 1, *OFFBOARD)
    t = 0.0
    while t < PERIOD * LAPS:
        t = vehicle.wait_for("LOCAL_POSITION_NED").time_boot_ms / 1000.0 - began
        vehicle.send_load_to(eight(t))
    vehicle.command(mavlink.MAV_CMD_DO_SET_MODE, 1, *RETURN)
    while vehicle.wait_for("HEARTBEAT").base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED:
        pass
    print("landed")


main(sys.argv[1] if len(sys.argv) > 1 else "udpin:127.0.0.1:14550")
