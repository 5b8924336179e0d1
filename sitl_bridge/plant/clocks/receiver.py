"""What both clocks do with the autopilot's datagrams: sort out answers, commands, strangers and junk."""

from __future__ import annotations

import math

from sitl_bridge.plant.log.notices import Notices
from sitl_bridge.plant.physics.state import STOPPED, Array
from sitl_bridge.plant.simulation import Simulation
from sitl_bridge.plant.wire.answers import (
    ANSWERED,
    ARMED,
    FOREIGN,
    JUNK,
    NOT_FINITE,
    OTHERS,
    foreign_system,
)


class HilReceiver:
    """Reads datagrams, lets the simulation handle what is no answer, and says what is wrong with them."""

    def __init__(self, simulation: Simulation, notices: Notices, instance: int) -> None:
        self.replies: list[bytes] = []
        """Datagrams to send back."""
        self.armed = False
        """Of the latest answer, likewise the next two."""
        self.controls: Array = STOPPED
        """(16,), 0..1 for a rotor; changed by the next answer."""
        self.time_usec = 0
        self._simulation = simulation
        self._notices = notices
        self._instance = instance
        self._reader = simulation.answers

    def receive(self, datagram: bytes) -> bool:
        """Take a datagram; returns whether it held an answer."""
        found = self._reader.read(datagram)
        if found & ~(ANSWERED | ARMED):
            self._look_closer(found, datagram)
        if not found & ANSWERED:
            return False
        self.time_usec = self._reader.time_usec
        self.armed = bool(found & ARMED)
        self.controls = self._reader.controls if self.armed else STOPPED
        return True

    def _look_closer(self, found: int, datagram: bytes) -> None:
        """What there is besides a good answer."""
        if found & FOREIGN:
            self._notices.once(
                "foreign",
                f"HIL_ACTUATOR_CONTROLS from system {foreign_system(found)} ignored: expected system "
                f"{self._instance + 1} (is the autopilot another --instance?)",
            )
        if found & JUNK:
            self._notices.once(
                "junk", f"{len(datagram)} bytes on the HIL link that are not MAVLink `common` frames: ignored"
            )
        if found & OTHERS:
            for frame in self._reader.others(datagram):
                if reply := self._simulation.handle(frame):
                    self.replies.append(reply)
        if found & NOT_FINITE:
            controls = self._reader.controls.tolist()
            which = [i for i, value in enumerate(controls) if not math.isfinite(value)]
            self._notices.once("not finite", f"controls {which} are not finite numbers: those rotors stop")
