"""A flight stack that a test plays: it answers as PX4 does."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.law.reference import Path, setpoint
from controller.over.companion import Companion
from controller.over.flight import OUR_SYSTEM, Flight
from controller.over.load.filtered import load_source
from controller.over.model import Steering
from controller.over.stack import Stack
from sitl_bridge.mavlink.framing import Packer, decode, split
from sitl_bridge.vehicle.files import load_vehicle

IRIS = load_vehicle("iris", ["initial.start=hover", "initial.load_position=[0,0,2.5]"])
OFFBOARD, HOLD, LAND, MANUAL = 6 << 16, 4 << 16 | 3 << 24, 4 << 16 | 6 << 24, 1 << 16
NO_LOCK = [
    mavlink.MAVLink_statustext_message(3, text, 7, part)
    for part, text in enumerate(
        (b"Preflight Fail: no GPS lock, and this text is long", b"er than fifty characters")
    )
]
IMU_AT_REST = (0.0, 0.0, -9.81, *(0.0,) * 10, 0x3F)


def parameter(name: str, value: float) -> Any:
    """PARAM_VALUE as PX4 has it: the bytes of an integer in the place of a float."""
    if isinstance(value, float):
        return mavlink.MAVLink_param_value_message(name.encode(), value, 9, 1, 0)
    [as_float] = struct.unpack("<f", struct.pack("<i", value))
    return mavlink.MAVLink_param_value_message(name.encode(), as_float, 6, 1, 0)


class PlayedStack:
    """Answers as PX4 does; a vehicle that stands still where it is told to."""

    def __init__(self) -> None:
        self._packer = Packer(1, 1)
        self.mode, self.armed, self.height, self.now = 0, False, 0.1, 0.0
        self.accepts_offboard = self.arms = self.lands = True
        self.frozen = False
        self.setpoints: list[Any] = []
        self.commands: list[Any] = []
        self.autopilot = mavlink.MAV_AUTOPILOT_PX4
        self.parameters: dict[str, float] = {"THR_MDL_FAC": 1.0, "COM_OF_LOSS_T": 1.0}
        self._ticks = 0

    def receive(self, datagram: bytes) -> list[bytes]:
        out = []
        for frame in split(datagram).frames:
            assert frame.system == OUR_SYSTEM
            message = decode(frame)
            if message.get_type() == "SET_ATTITUDE_TARGET":
                self.setpoints.append(message)
            elif message.get_type() == "PARAM_REQUEST_READ":
                name = message.param_id.rstrip("\0")
                if name in self.parameters:
                    out.append(parameter(name, self.parameters[name]))
            elif message.get_type() == "COMMAND_LONG":
                self.commands.append(message)
                if not self.arms:
                    out += NO_LOCK
                out.append(mavlink.MAVLink_command_ack_message(message.command, self.obey(message)))
        return [self._packer.pack(message) for message in out]

    def obey(self, message: Any) -> int:
        """What it does with a command; a MAV_RESULT."""
        if message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            if not self.arms:
                return int(mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
            self.armed = True
        elif message.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            self.height = message.param7 - 488.0
        elif message.command == mavlink.MAV_CMD_DO_SET_MODE:
            mode = int(message.param2) << 16 | int(message.param3) << 24
            if mode == OFFBOARD and not (self.accepts_offboard and self.setpoints):
                return int(mavlink.MAV_RESULT_DENIED)
            self.mode = mode
            self.armed = self.armed and not (mode == LAND and self.lands)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def tick(self) -> bytes:
        """10 ms of telemetry."""
        self.now += 0.01
        self._ticks += 1
        flag = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        out = []
        if self._ticks % 50 == 1:
            out.append(mavlink.MAVLink_heartbeat_message(2, self.autopilot, 1 | flag, self.mode, 4, 3))
            height = round(1000 * self.height)
            out.append(
                mavlink.MAVLink_global_position_int_message(1, 0, 0, 488_000 + height, height, 0, 0, 0, 0)
            )
        if not self.frozen:
            out.append(mavlink.MAVLink_highres_imu_message(round(1e6 * self.now), *IMU_AT_REST))
            out += self.state()
        return b"".join(self._packer.pack(message) for message in out)

    def state(self) -> list[Any]:
        """The messages with where the vehicle is."""
        nan = [math.nan] + [0.0] * 20
        zeros = (0.0,) * 6
        return [
            mavlink.MAVLink_odometry_message(
                round(1e6 * self.now), 1, 12, 0.0, 0.0, -self.height, [1, 0, 0, 0], *zeros, nan, nan
            )
        ]


class Played:
    """A companion against the played stack, in played time."""

    def __init__(
        self,
        duration: float = 2.0,
        wait_s: float = 60.0,
        stack: PlayedStack | None = None,
        steering: Steering = Steering.RATES,
    ) -> None:
        self.stack, self.said = stack or PlayedStack(), list[str]()

        def path(start: tuple[float, float, float]) -> Path:
            return setpoint(start, start)

        source = load_source("none", IRIS)
        self.flight = Flight(IRIS, Stack(), source, path, duration, self.said.append, steering=steering)
        self.companion = Companion(self.flight, wait_s)

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        for _ in range(round(100 * seconds)):
            self.companion.receive(self.stack.tick(), self.stack.now)
            for datagram in self.companion.to_send(self.stack.now):
                for answer in self.stack.receive(datagram):
                    self.companion.receive(answer, self.stack.now)
            if until():
                return
