"""What both clocks do with the autopilot's datagrams: sort out answers, commands, strangers and junk."""

from __future__ import annotations

import math

from sitl_bridge.plant.answers import Answer, AnswerReader
from sitl_bridge.plant.notices import Notices
from sitl_bridge.plant.simulation import Simulation


class HilReceiver:
    """Reads datagrams, lets the simulation handle what is no answer, and says what is wrong with them."""

    def __init__(self, simulation: Simulation, notices: Notices, instance: int) -> None:
        self.replies: list[bytes] = []
        """Datagrams to send back."""
        self._simulation = simulation
        self._notices = notices
        self._instance = instance
        self._reader = AnswerReader(instance)

    def receive(self, datagram: bytes) -> Answer | None:
        """The answer in a datagram, if there is one."""
        received = self._reader.read(datagram)
        if received.foreign_system is not None:
            self._notices.once(
                "foreign",
                f"HIL_ACTUATOR_CONTROLS from system {received.foreign_system} ignored: expected system "
                f"{self._instance + 1} (is the autopilot another --instance?)",
            )
        if received.junk:
            self._notices.once(
                "junk", f"{len(datagram)} bytes on the HIL link that are not MAVLink `common` frames: ignored"
            )
        for frame in received.others:
            if reply := self._simulation.handle(frame):
                self.replies.append(reply)
        answer = received.answer
        if answer is not None and not all(map(math.isfinite, answer.controls)):
            which = [i for i, value in enumerate(answer.controls) if not math.isfinite(value)]
            self._notices.once("not finite", f"controls {which} are not finite numbers: those rotors stop")
        return answer
