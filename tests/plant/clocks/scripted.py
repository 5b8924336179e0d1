"""A simulation that only counts what a clock does to it, and an autopilot's answers to it."""

from __future__ import annotations

from typing import Any

import numpy as np

from controller.hil.answers import AnswerWriter
from sitl_bridge.ids import COMPONENT_AUTOPILOT
from sitl_bridge.mavlink.framing import Frame, Packer
from sitl_bridge.plant.physics.state import Array
from sitl_bridge.plant.wire.answers import AnswerReader

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
        self.may_exchange = False
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
        if self.may_exchange:
            self.done.append("exchanged")
            self.tick += 1
        return self.may_exchange

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


def four(value: float) -> list[float]:
    return np.float32([value] * 4).astype(float).tolist()
