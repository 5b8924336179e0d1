"""Plant and controller, each started on its own, so that a test can stop, stall and start either."""

from __future__ import annotations

from collections.abc import Callable

from sitl.flights.free_ports import free_ports
from tests.loopback.conftest import Process


class ByHand:
    """A vehicle on the ground that waits for ground control, in lockstep on free ports."""

    def __init__(
        self,
        start: Callable[..., Process],
        both: tuple[str, ...] = (),
        controller: tuple[str, ...] = (),
        speed: float = 1.0,
    ) -> None:
        """both: arguments of plant and controller; controller: of that one alone."""
        self.hil, self.gcs, self.gcs_peer, self.onboard, self.onboard_peer = free_ports(5)
        self._start = start
        self._both = ("--scenario", "hold", *both)
        self._controller = controller
        plant = ("--hil", f"udpout:127.0.0.1:{self.hil}", "--clock", "lockstep", "--speed", f"{speed:g}")
        self.plant = start("plant", *self._both, *plant)
        self.controller = self.start_controller()

    def start_controller(self) -> Process:
        """Start it, once more if it was there before."""
        links = ("--gcs", f"{self.gcs}:{self.gcs_peer}", "--onboard", f"{self.onboard}:{self.onboard_peer}")
        hil = ("--hil", f"udpin:127.0.0.1:{self.hil}")
        self.controller = self._start("controller", *self._both, *hil, *links, *self._controller)
        self.controller.wait_for("plant connected")
        return self.controller
