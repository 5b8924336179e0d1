"""Our own autopilot as the flight stack, a plant for it, and companions over it."""

from __future__ import annotations

import contextlib
import json
import os
import select
import socket
import threading
import tty
from collections.abc import Callable
from pathlib import Path

from sitl.flights.free_ports import free_ports
from tests.loopback.conftest import Process

IRIS = ("--vehicle", "iris", "--sensors", "rtk")
PATIENT = {"COM_OF_LOSS_T": 3.0, "COM_HIL_LOSS_T": 10.0}
"""s: on a busy machine a process that gets no turn for a second has not lost its link"""
STEP = """vehicle = "iris"
duration = 12.0
[reference]
kind = "setpoint"
position = [3.0, 0.0, 2.5]
"""


class StandIn:
    """Plant and autopilot in lockstep at real time's pace, on free ports."""

    def __init__(self, start: Callable[..., Process], folder: Path) -> None:
        self.hil, self.gcs, self.gcs_peer, self.onboard, self.onboard_peer = free_ports(5)
        [self.truth] = free_ports(1)
        self._start = start
        self.step = folder / "step.toml"
        self.step.write_text(STEP)
        self._parameters = folder / "parameters.json"
        self._parameters.write_text(json.dumps(PATIENT))

    def start_plant(self) -> Process:
        """The plant, as `fly` would launch it."""
        hil = ("--hil", f"tcpin:127.0.0.1:{self.hil}", "--truth-to", f"127.0.0.1:{self.truth}")
        return self._start("plant", *IRIS, *hil)

    def start_stack(self) -> Process:
        """Our autopilot under ground control."""
        links = ("--gcs", f"{self.gcs}:{self.gcs_peer}", "--onboard", f"{self.onboard}:{self.onboard_peer}")
        hil = ("--hil", f"tcpout:127.0.0.1:{self.hil}", "--parameters", str(self._parameters))
        return self._start("controller", "--scenario", "hold", *IRIS, *hil, *links)

    @property
    def over(self) -> str:
        """The address of the stack."""
        return f"udpin:127.0.0.1:{self.onboard_peer}"

    def start_companion(self, over: str) -> Process:
        """A companion that holds the load on truth; over: the stack's address."""
        truth = ("--load", "truth", "--truth-from", f"udpin:127.0.0.1:{self.truth}")
        return self._start("controller", "--scenario", "hover", *IRIS, "--over", over, *truth)


class SerialLine:
    """A pseudo-terminal whose other end speaks UDP with an autopilot, as a telemetry radio's would."""

    def __init__(self, own_port: int) -> None:
        self._end, far = os.openpty()
        tty.setraw(far)
        os.set_blocking(self._end, False)
        self.device = os.ttyname(far)
        self._far = far
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", own_port))
        self._socket.settimeout(0.2)
        self._peer: tuple[str, int] | None = None
        self._running = True
        self._threads = [threading.Thread(target=self._down), threading.Thread(target=self._up)]
        for thread in self._threads:
            thread.start()

    def _down(self) -> None:
        while self._running:
            try:
                data, self._peer = self._socket.recvfrom(65536)
            except TimeoutError:
                continue
            with contextlib.suppress(BlockingIOError):  # nobody reads: lost, as on a line
                os.write(self._end, data)

    def _up(self) -> None:
        while self._running:
            if not select.select([self._end], [], [], 0.2)[0]:
                continue
            data = os.read(self._end, 4096)
            if self._peer is not None and data:
                self._socket.sendto(data, self._peer)

    def close(self) -> None:
        """Free everything."""
        self._running = False
        for thread in self._threads:
            thread.join()
        for descriptor in (self._end, self._far):
            os.close(descriptor)
        self._socket.close()
