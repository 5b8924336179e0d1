"""Pause, single steps and slow motion over MAVLink: two parameters of the plant. No I/O.

SIM_SPEEDUP as in ArduPilot's simulator: simulated seconds a second. Here 0 lets time stand still, and -1 runs
as fast as it goes. SIM_STEPS lets a plant that stands still go on for so many ticks. Both are parameters of
the plant's component and can be set in lockstep only; real time has SIM_SPEEDUP alone, and it stays 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import common

from sitl_bridge.ids import COMPONENT_TRUTH, vehicle_system
from sitl_bridge.mavlink.framing import Frame, Packer, decode, split
from sitl_bridge.plant.clocks.lockstep import Lockstep
from sitl_bridge.plant.clocks.realtime import Realtime

SPEED, STEPS = "SIM_SPEEDUP", "SIM_STEPS"
AS_FAST_AS_IT_GOES = -1.0
MOST_STEPS = 100_000


class SpeedService:
    """Answers the parameter protocol for one clock."""

    def __init__(self, instance: int, clock: Lockstep | Realtime, say: Callable[[str], None]) -> None:
        self._system = vehicle_system(instance)
        self._packer = Packer(self._system, COMPONENT_TRUTH)
        self._clock = clock
        self._say = say

    def receive(self, datagram: bytes, now: float) -> bytes:
        """Take what a viewer or a station says; the reply, or nothing."""
        return b"".join(self._answer(frame, now) for frame in split(datagram).frames)

    def _answer(self, frame: Frame, now: float) -> bytes:
        if frame.message_id not in _HANDLED:
            return b""
        try:
            message = decode(frame)
        except Exception:  # pymavlink raises many kinds of errors for a payload that it can't unpack
            return b""
        if message.target_system not in (0, self._system):
            return b""
        if message.target_component not in (0, COMPONENT_TRUTH):
            return b""
        names = self._names()
        if frame.message_id == common.MAVLINK_MSG_ID_PARAM_REQUEST_LIST:
            return b"".join(map(self._value, names))
        name = message.param_id.rstrip("\0")
        if frame.message_id == common.MAVLINK_MSG_ID_PARAM_REQUEST_READ and message.param_index >= 0:
            name = names[message.param_index] if message.param_index < len(names) else ""
        if name not in names:
            return b""
        if frame.message_id == common.MAVLINK_MSG_ID_PARAM_SET:
            self._set(name, float(message.param_value), now)
        return self._value(name)

    def _names(self) -> tuple[str, ...]:
        return (SPEED, STEPS) if isinstance(self._clock, Lockstep) else (SPEED,)

    def _set(self, name: str, value: float, now: float) -> None:
        """A value that cannot be is answered by the one that stays."""
        clock = self._clock
        if not isinstance(clock, Lockstep) or not math.isfinite(value):
            return
        if name == STEPS:
            clock.step(int(max(0.0, min(value, MOST_STEPS))), now)
            return
        if (value == 0.0) != (clock.speed == 0.0):
            at = f"t = {clock.simulation.scenario_time:.3f} s"
            self._say(f"paused at {at}: {SPEED} is 0" if value == 0.0 else f"goes on at {at}")
        clock.change_speed(None if value < 0.0 else value, now)

    def _value(self, name: str) -> bytes:
        """PARAM_VALUE."""
        clock, names = self._clock, self._names()
        value = 1.0
        if isinstance(clock, Lockstep):
            speed = AS_FAST_AS_IT_GOES if clock.speed is None else clock.speed
            value = speed if name == SPEED else float(clock.steps_left)
        message: Any = common.MAVLink_param_value_message(
            name.encode(), value, common.MAV_PARAM_TYPE_REAL32, len(names), names.index(name)
        )
        return self._packer.pack(message)


_HANDLED = (
    common.MAVLINK_MSG_ID_PARAM_REQUEST_LIST,
    common.MAVLINK_MSG_ID_PARAM_REQUEST_READ,
    common.MAVLINK_MSG_ID_PARAM_SET,
)
