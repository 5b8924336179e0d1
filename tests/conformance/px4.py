"""A PX4 as its simulator sees it: connects, boots in silence, then answers every HIL_SENSOR."""

from __future__ import annotations

import select
import socket
import subprocess
import sys
import time
from collections import deque
from collections.abc import Sequence
from typing import Any

from pymavlink.dialects.v20 import common

from sitl.flights.free_ports import free_ports
from tests.patience import PATIENCE

LOCKSTEP = common.HIL_ACTUATOR_CONTROLS_FLAGS_LOCKSTEP
ARMED = common.MAV_MODE_FLAG_SAFETY_ARMED
STATE_INTERVAL_US = 5000


class Plant:
    """`sitl plant` as its own process."""

    def __init__(self, *arguments: str) -> None:
        command = [sys.executable, "-m", "sitl", "plant", *arguments]
        self.popen = subprocess.Popen(command, stdin=subprocess.DEVNULL)

    def close(self) -> None:
        self.popen.kill()
        self.popen.wait()


class Px4:
    """One end of the HIL link. `transport`: "tcp" (connects and retries) or "udp" (binds and waits)."""

    def __init__(self, transport: str) -> None:
        self._reliable = transport == "tcp"
        kind = socket.SOCK_STREAM if self._reliable else socket.SOCK_DGRAM
        [self.port] = free_ports(1, kind)
        self._socket = socket.socket(socket.AF_INET, kind)
        self._peer: Any = None
        if not self._reliable:
            self._socket.bind(("127.0.0.1", self.port))
        self._mavlink = common.MAVLink(None, srcSystem=1, srcComponent=1)
        self._waiting: deque[Any] = deque()
        self.messages: list[Any] = []
        """Everything received, in order; repeats of a tick, which UDP may bring, left out."""
        self.last_time = 0
        self.repeats = 0

    @property
    def address(self) -> str:
        """What the plant is told with --hil."""
        return f"{'tcpin' if self._reliable else 'udpout'}:127.0.0.1:{self.port}"

    def connect(self) -> None:
        """Find the simulator and say what PX4 says: HEARTBEAT and SET_MESSAGE_INTERVAL for message 115."""
        deadline = time.monotonic() + PATIENCE
        if self._reliable:
            while self._socket.connect_ex(("127.0.0.1", self.port)):
                assert time.monotonic() < deadline, "nobody listens"
                self._socket.close()
                time.sleep(0.1)
                self._socket = socket.socket()
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        else:
            readable, _, _ = select.select([self._socket], [], [], PATIENCE)
            assert readable, "no datagram"
            _, self._peer = self._socket.recvfrom(65536)  # wakes it; the content is discarded
        self._say(common.MAVLink_heartbeat_message(2, common.MAV_AUTOPILOT_PX4, 0, 0, 0, 3))
        self._say(common.MAVLink_command_long_message(0, 0, 511, 0, 115, STATE_INTERVAL_US, 0, 0, 0, 0, 0))

    def _say(self, message: Any) -> None:
        data = message.pack(self._mavlink)
        if self._reliable:
            self._socket.sendall(data)
        else:
            self._socket.sendto(data, self._peer)

    def answer(self, controls: Sequence[float] = (), armed: bool = False) -> None:
        """HIL_ACTUATOR_CONTROLS for the latest HIL_SENSOR."""
        values = [*controls, *[0.0] * (16 - len(controls))]
        mode = ARMED if armed else 0
        self._say(common.MAVLink_hil_actuator_controls_message(self.last_time, values, mode, LOCKSTEP))

    def heard(self, wait: float) -> bool:
        """Whether anything new (no repeated tick) comes within so many seconds."""
        deadline = time.monotonic() + wait
        while not self._waiting:
            left = deadline - time.monotonic()
            if left <= 0 or not select.select([self._socket], [], [], left)[0]:
                return bool(self._waiting)
            self._take(self._socket.recvfrom(65536))
        return True

    def _take(self, received: tuple[bytes, Any]) -> None:
        data, sender = received
        if not self._reliable:
            self._peer = sender
            assert len(data) <= 2048
        found = self._mavlink.parse_buffer(data) or []
        ticks = [message for message in found if message.get_type() == "HIL_SENSOR"]
        if not self._reliable and ticks:
            assert found[-1] is ticks[0], "HIL_SENSOR is the last of its datagram"
            if ticks[0].time_usec <= self.last_time:
                self.repeats += 1
                return
        self._waiting += found

    def tick(self) -> list[Any]:
        """All messages up to the next HIL_SENSOR, which is the last of them."""
        out = []
        deadline = time.monotonic() + PATIENCE
        while True:
            assert self.heard(1.0) or time.monotonic() < deadline, "the plant is silent"
            while self._waiting:
                out.append(self._waiting.popleft())
                self.messages.append(out[-1])
                if out[-1].get_type() == "HIL_SENSOR":
                    assert out[-1].time_usec > self.last_time, "time only grows"
                    self.last_time = out[-1].time_usec
                    return out

    def of(self, kind: str) -> list[Any]:
        return [message for message in self.messages if message.get_type() == kind]

    def close(self) -> None:
        self._socket.close()
