"""What a controller under ground control needs beside the HIL link, put together."""

from __future__ import annotations

import math
from collections.abc import Callable

from controller.design.client import DesignProcess
from controller.feedback.assessment import Assessor
from controller.law.state import Array
from controller.pilot.guided.autopilot import GuidedAutopilot
from controller.pilot.guided.link import GroundLink
from controller.pilot.guided.options import GroundOptions
from sitl_bridge.ids import COMPONENT_AUTOPILOT, vehicle_system
from sitl_bridge.mavlink.framing import Packer
from sitl_bridge.vehicle.description import Vehicle

LONGEST_WAIT = 0.02
"""s, between two looks at the sockets when the plant is silent"""
LOOK_PERIOD = 0.001
"""s, at least, between two looks when it is not: ticks may come far faster"""


class Guided:
    """Ground-control link, background designer and autopilot of one vehicle."""

    def __init__(
        self,
        vehicle: Vehicle,
        rate_hz: float,
        instance: int,
        options: GroundOptions | None,
        say: Callable[[str], None],
        assessor: Assessor | None = None,
        on_statustext: Callable[[str], None] = lambda text: None,
    ) -> None:
        """on_statustext: takes what goes to every ground station.

        Raises OSError when a port is taken, KeyFileError for a key that is none."""
        self._vehicle = vehicle
        self._assessor = assessor
        self._rate_hz = rate_hz
        self._link = GroundLink(vehicle, instance, options or GroundOptions(), say, on_statustext)
        self._designer = DesignProcess(vehicle, rate_hz)
        self._packer = Packer(vehicle_system(instance), COMPONENT_AUTOPILOT)
        self._pilot: GuidedAutopilot | None = None
        self._next_look = -math.inf

    def autopilot(self, controls: Array) -> GuidedAutopilot:
        """The autopilot around its rotor commands (16,)."""
        self._pilot = GuidedAutopilot(
            self._vehicle, self._rate_hz, self._link.station, self._designer, controls, self._assessor
        )
        return self._pilot

    def next_deadline(self, now: float) -> float:
        """When ground control wants attention, if the plant says nothing before."""
        return min(self._link.station.next_deadline(now), now + LONGEST_WAIT)

    @property
    def mode_title(self) -> str:
        """The vehicle's mode, for a person."""
        return self._link.station.mode_title

    @property
    def shut_down(self) -> bool:
        """Whether a client has asked for the end of the process."""
        return self._link.station.shut_down

    def to_plant(self, now: float) -> list[bytes]:
        """Datagrams for the plant: commands of ground control that are for it to carry out."""
        messages = self._link.station.plant_commands.to_plant(now)
        return [self._packer.pack(message) for message in messages]

    def serve(self, now: float, heard: bool) -> bool:
        """Serve ground control, if it is time to; `heard`: whether the plant has just said something.

        Returns whether it was: else nothing is different from the last time.
        """
        if heard and now < self._next_look and now < self._link.station.next_deadline(now):
            return False
        self._next_look = now + LOOK_PERIOD
        if not heard and self._pilot is not None:
            self._pilot.wait(now)
        self._link.serve(now)
        return True

    def close(self) -> None:
        """Free the ports, give up what is under way."""
        self._link.close()
        self._designer.close()
