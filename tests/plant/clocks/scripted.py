"""A simulation that only counts what a clock does to it, and an autopilot's answers to it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

import numpy as np

from controller.hil.answers import AnswerWriter
from sitl_bridge.ids import COMPONENT_AUTOPILOT
from sitl_bridge.mavlink.framing import Frame, Packer
from sitl_bridge.plant.clocks.lockstep import Lockstep
from sitl_bridge.plant.clocks.realtime import Realtime
from sitl_bridge.plant.log.notices import Notices
from sitl_bridge.plant.physics.state import Array
from sitl_bridge.plant.wire.answers import AnswerReader

C = TypeVar("C", Lockstep, Realtime)

PERIOD = 0.004
TICK_US = 4000


class CountedWorld:
    """What a clock asks of the world."""

    steps_per_tick = 8

    def __init__(self, delay_ticks: int) -> None:
        self.vehicle = self
        self.loop = self
        self.delay_ticks = delay_ticks


class CountedSimulation:
    """Keeps what the clock has asked for, in order, in `done`."""

    period = PERIOD

    def __init__(self, instance: int = 0, delay_ticks: int = 0, last_tick: int = 10**9) -> None:
        self.answers = AnswerReader(instance)
        self.world = CountedWorld(delay_ticks)
        self.tick = 1
        self.started = False
        self.done: list[Any] = []
        self.flies_whole = False
        self._last_tick = last_tick

    @property
    def time_usec(self) -> int:
        return self.tick * TICK_US

    @property
    def finished(self) -> bool:
        return self.tick > self._last_tick

    def datagram(self) -> bytes:
        return b"tick %d" % self.tick

    def next_tick(self) -> None:
        self.done.append("held")
        self.tick += 1

    def step(self, controls: Array) -> None:
        self.done.append(("flown", controls[:4].tolist()))
        self.tick += 1

    def fly_tick(self, commands: Any) -> None:
        self.done.append([(command.step, command.controls[:4].tolist()) for command in commands])
        self.tick += 1

    def fly_whole_tick(self, datagram: bytes) -> bool:
        if self.flies_whole:
            self.done.append("flown whole")
            self.tick += 1
        return self.flies_whole

    def heard(self) -> None:
        self.done.append("heard")

    def begin(self) -> None:
        self.done.append("begun")
        self.started = True

    def handle(self, frame: Frame) -> bytes | None:
        self.done.append(("message", frame.message_id))
        return b"reply %d" % frame.message_id if frame.message_id == 76 else None


class Answers:
    """What an autopilot says."""

    def __init__(self, instance: int = 0) -> None:
        self.packer = Packer(instance + 1, COMPONENT_AUTOPILOT)
        self._writer = AnswerWriter(instance, self.packer)

    def to(self, tick: int, *controls: float, armed: bool = True) -> bytes:
        """The answer to a tick, with the controls of the first rotors."""
        self._writer.controls[:] = 0.0
        self._writer.controls[: len(controls)] = controls
        return bytes(self._writer.answer(tick * TICK_US, armed))


class ScriptedClock(Generic[C]):
    """A clock that was started at 100 s, and the time that the test has come to."""

    def __init__(
        self,
        make: Callable[[CountedSimulation, Notices, int], C],
        simulation: CountedSimulation,
        instance: int = 0,
    ) -> None:
        self.said: list[str] = []
        self.simulation = simulation
        self.clock = make(simulation, Notices(self.said.append), instance)
        self.answers = Answers(instance)
        self.now = 100.0
        self.clock.start(self.now)

    def send(self, after: float = 0.0) -> list[bytes]:
        """What goes out so many seconds later."""
        self.now += after
        return self.clock.to_send(self.now)

    def send_when_due(self) -> list[bytes]:
        """What goes out at the next deadline."""
        self.now = self.clock.next_deadline()
        return self.send()

    def answer(self, tick: int, *controls: float, armed: bool = True, after: float = 0.0) -> None:
        """The autopilot answers, so many seconds later."""
        self.now += after
        self.clock.receive(self.answers.to(tick, *controls, armed=armed), self.now)


def four(value: float) -> list[float]:
    return np.float32([value] * 4).astype(float).tolist()
