"""A ground station made of pymavlink, for what MAVSDK and MAVProxy cannot say."""

from __future__ import annotations

import math
import os
import queue
import threading
import time
from collections.abc import Callable
from typing import Any

from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mavlink

from tests.patience import LONG_PATIENCE, PATIENCE

os.environ["MAVLINK20"] = "1"  # else pymavlink begins with MAVLink 1, and is answered in that
mavutil.set_dialect("common")

HOLD, LAND, OFFBOARD = (4, 3), (4, 6), (6, 0)
"""PX4's main and sub modes"""


class PyMav:
    """One connection, which keeps everything that it hears.

    A thread beats and empties the socket all the time, as those of real ground stations do, whatever the test
    waits for meanwhile. The socket's buffer holds two seconds of a vehicle's telemetry: once it is full, the
    kernel drops what comes next, an answer too. Ten seconds without a HEARTBEAT are a lost station.
    """

    def __init__(self, connection: str, system: int = 245, component: int = 190) -> None:
        self.link = mavutil.mavlink_connection(connection, source_system=system, source_component=component)
        self.heard: list[Any] = []
        self._texts: list[str] = []
        self._arrived: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._closing = False
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        beat = 0.0
        while not self._closing:
            if time.monotonic() >= beat:
                beat = time.monotonic() + 0.5
                self.link.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)
            message = self.link.recv_match(blocking=True, timeout=0.05)
            if message is not None:
                self._arrived.put(message)

    def close(self) -> None:
        """Free the port."""
        self._closing = True
        self._reader.join()
        self.link.close()

    def poll(self) -> Any | None:
        """The next message, if one comes soon."""
        try:
            message = self._arrived.get(timeout=0.05)
        except queue.Empty:
            return None
        self._keep(message)
        return message

    def _keep(self, message: Any) -> None:
        self.heard.append(message)
        if message.get_type() == "STATUSTEXT":
            if message.id and message.chunk_seq and self._texts:
                self._texts[-1] += message.text
            else:
                self._texts.append(message.text)

    def _catch_up(self) -> None:
        """Take in what came before: it is no answer to what is asked next."""
        while not self._arrived.empty():
            self._keep(self._arrived.get())

    def wait(self, holds: Callable[[Any], Any], what: str, patience: float = PATIENCE) -> Any:
        """The next message for which something is true."""
        deadline = time.monotonic() + patience
        while time.monotonic() < deadline:
            message = self.poll()
            if message is not None and holds(message):
                return message
        raise AssertionError(f"{what}: not within {patience:g} s; heard {self.texts()}")

    def wait_for(self, kind: str, system: int = 1, patience: float = PATIENCE) -> Any:
        """The next message of a type from a system."""
        return self.wait(lambda m: m.get_type() == kind and m.get_srcSystem() == system, kind, patience)

    def listen(self, seconds: float) -> list[Any]:
        """Everything that comes in some seconds."""
        begin, deadline = len(self.heard), time.monotonic() + seconds
        while time.monotonic() < deadline:
            self.poll()
        return self.heard[begin:]

    def let_pass(self, seconds: float, meanwhile: Callable[[], None] = lambda: None) -> None:
        """Wait so many seconds on the vehicle's clock; meanwhile: called with every message."""
        begin: list[int] = []

        def over(message: Any) -> bool:
            meanwhile()
            if message.get_type() != "LOCAL_POSITION_NED" or message.get_srcSystem() != 1:
                return False
            begin.append(message.time_boot_ms)
            return begin[-1] - begin[0] >= 1e3 * seconds

        self.wait(over, f"{seconds:g} s of the vehicle's time", LONG_PATIENCE)

    def texts(self) -> list[str]:
        """STATUSTEXTs, pieces joined."""
        return self._texts

    def wait_for_text(self, words: str, patience: float = PATIENCE) -> None:
        """Wait until the vehicle says something, or has said it."""
        deadline = time.monotonic() + patience
        while not any(words in text for text in self._texts):
            assert time.monotonic() < deadline, f"nobody said {words!r}: {self._texts}"
            self.poll()

    def command(self, number: int, *parameters: float, patience: float = PATIENCE) -> int:
        """Send a COMMAND_LONG; its result."""
        values = [*parameters, *[math.nan] * (7 - len(parameters))]
        self._catch_up()
        self.link.mav.command_long_send(1, 1, number, 0, *values)
        ack = self.wait(lambda m: m.get_type() == "COMMAND_ACK" and m.command == number, "ack", patience)
        return int(ack.result)

    def command_int(self, number: int, *parameters: float, patience: float = PATIENCE) -> int:
        """Send a COMMAND_INT with up to four parameters and no place; its result."""
        values = [*parameters, *[math.nan] * (4 - len(parameters))]
        self._catch_up()
        relative = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
        self.link.mav.command_int_send(1, 1, relative, number, 0, 0, *values, 0, 0, math.nan)
        ack = self.wait(lambda m: m.get_type() == "COMMAND_ACK" and m.command == number, "ack", patience)
        return int(ack.result)

    def ready(self) -> None:
        """Wait until the vehicle can be armed."""
        flag = mavlink.MAV_SYS_STATUS_PREARM_CHECK
        self.wait(
            lambda m: m.get_type() == "SYS_STATUS" and m.onboard_control_sensors_health & flag, "ready to arm"
        )

    def set_parameter(self, name: str, value: float) -> None:
        """Set a REAL32 parameter and see it set."""
        self.link.mav.param_set_send(1, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)
        self.wait(lambda m: m.get_type() == "PARAM_VALUE" and m.param_id == name, name)

    def wait_for_mode(self, mode: tuple[int, int], meanwhile: Callable[[], None] = lambda: None) -> None:
        """Wait until the vehicle's HEARTBEAT shows a mode; meanwhile: called with every message."""
        number = mode[0] << 16 | mode[1] << 24

        def shown(message: Any) -> bool:
            meanwhile()
            is_heartbeat = message.get_type() == "HEARTBEAT" and message.get_srcSystem() == 1
            return is_heartbeat and message.custom_mode == number

        self.wait(shown, f"mode {mode}")

    def wait_until_disarmed(self) -> None:
        """Wait until the vehicle's HEARTBEAT says so."""
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        self.wait(
            lambda m: m.get_type() == "HEARTBEAT" and m.get_srcSystem() == 1 and not m.base_mode & armed,
            "disarmed",
        )

    def wait_until_in_air(self) -> None:
        """Wait until the take-off is over."""
        in_air = mavlink.MAV_LANDED_STATE_IN_AIR
        self.wait(lambda m: m.get_type() == "EXTENDED_SYS_STATE" and m.landed_state == in_air, "in the air")
