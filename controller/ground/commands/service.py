"""COMMAND_LONG, COMMAND_INT and SET_MODE: from a message to its one acknowledgement."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Hashable
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.commands.command import Command, Requests, command_of
from controller.ground.commands.commands import execute
from controller.ground.commands.memory import Key, Memory
from controller.ground.commands.plant_commands import Answer, PlantCommands
from controller.ground.commands.result import INFO, WARNING, Notice, Verdict
from controller.ground.flight.modes import Machine
from controller.ground.link.outbox import Outbox
from controller.ground.link.packing import AvailableModes
from controller.ground.link.peers import Peer
from controller.ground.parameters.storage import StoredParameters
from controller.ground.telemetry import messages as telemetry
from controller.ground.telemetry.message_rates import STREAMABLE
from sitl_bridge.ids import COMPONENT_AUTOPILOT, COMPONENT_LOAD, COMPONENT_WINCH
from sitl_bridge.mavlink.framing import Frame

Build = Callable[[int, float], Any]
"""A message as it is at a time, by its number; None if there is none"""


class CommandService:
    """Knows a retransmission from a new command, and waits for the plant where that has the answer."""

    def __init__(
        self,
        machine: Machine,
        out: Outbox,
        stored: StoredParameters,
        build: Build,
        show_state: Callable[[float], None],
    ) -> None:
        """show_state: sends what HEARTBEAT and the like say, if that has changed."""
        self.plant = PlantCommands()
        self.machine = machine
        self.out = out
        self.stored = stored
        self.build = build
        self._show_state = show_state
        self._memory = Memory()
        self.restart = ""
        """What a client asked for: "reboot", "shut down", or nothing"""
        self._under_way: set[Hashable] = set()
        """Commands whose verdict is still to come"""

    def receive(self, message: Any, frame: Frame, peer: Peer, component: int, now: float) -> None:
        """A command for the vehicle's autopilot or winch, or for the load."""
        command = command_of(message, component)
        source = {COMPONENT_LOAD: self.out.load, COMPONENT_WINCH: self.out.winch}.get(component)
        sender = (peer.address, frame.system, frame.component)
        numbers = struct.pack("<7d", *_finite(command))
        key = Key(sender, (message.id, component, command.number, numbers))
        confirmation = getattr(message, "confirmation", 0)
        sequence = frame.raw[4 if frame.version == 2 else 2]

        def acknowledge(verdict: Verdict, now: float) -> None:
            ack = mavlink.MAVLink_command_ack_message
            reply = ack(command.number, verdict.result, 0, 0, frame.system, frame.component)
            self.out.send(peer, reply, now, source)

        def finish(verdict: Verdict, now: float) -> None:
            self._under_way.discard(key)
            self._memory.store(key, sequence, confirmation, verdict, now)
            if not verdict.ok:
                self.out.say(peer, Notice(WARNING, verdict.text), now)
            # A client that waits for a mode after its command is accepted must not see the old one then.
            self._show_state(now)
            acknowledge(verdict, now)

        before = self._memory.recall(key, sequence, confirmation, now)
        if before is not None:
            acknowledge(before, now)
        elif key not in self._under_way:
            verdict = execute(command, self.machine, _PeerRequests(self, peer, now, finish), now)
            if verdict is None:
                self._under_way.add(key)
            else:
                finish(verdict, now)

    def set_mode(self, message: Any, peer: Peer, now: float) -> None:
        """SET_MODE, which some clients still send instead of DO_SET_MODE."""
        main, sub = message.custom_mode >> 16 & 0xFF, message.custom_mode >> 24 & 0xFF
        command = Command(
            mavlink.MAV_CMD_DO_SET_MODE,
            message.base_mode,
            main,
            sub,
            *(math.nan,) * 4,
            False,
            "",
            COMPONENT_AUTOPILOT,
        )
        verdict = execute(command, self.machine, _PeerRequests(self, peer, now, lambda *_: None), now)
        if verdict is not None and not verdict.ok:
            self.out.say(peer, Notice(WARNING, verdict.text), now)


class _PeerRequests(Requests):
    """What a command can ask for, on behalf of the peer that sent it."""

    def __init__(self, service: CommandService, peer: Peer, now: float, finish: Answer) -> None:
        self._service, self._peer, self._now = service, peer, now
        self._finish = finish

    def send_message(self, message_id: int, index: float) -> bool:
        """Send one message once; False if there is no such message."""
        out, peer, now = self._service.out, self._peer, self._now
        if message_id == AvailableModes.id:
            modes = telemetry.available_modes(0.0 if math.isnan(index) else index)
            for mode in modes:
                out.send(peer, mode, now)
            return bool(modes)
        if message_id == mavlink.MAVLINK_MSG_ID_MESSAGE_INTERVAL:
            if not (0 <= index <= 0xFFFF):
                return False
            self.send_interval(index)
            return True
        message = self._service.build(message_id, now)
        if message is not None:
            out.send(peer, message, now)
        return message is not None

    def set_interval(self, message_id: float, microseconds: float) -> Verdict:
        """Stream a message at an interval."""
        return self._peer.streams.set_interval(message_id, microseconds, self._now)

    def send_interval(self, message_id: float) -> None:
        """Send MESSAGE_INTERVAL: 0 for a message that cannot be streamed, -1 for one that is off."""
        interval = self._peer.streams.interval(int(message_id))
        off = -1 if message_id in STREAMABLE else 0
        microseconds = off if interval is None else round(interval * 1e6)
        message = mavlink.MAVLink_message_interval_message(int(message_id), microseconds)
        self._service.out.send(self._peer, message, self._now)

    def storage(self, action: float) -> Verdict:
        """Load, save or reset the parameters."""
        return self._service.stored.act(action, self._service.machine.flying)

    def inject_failure(self, parameters: tuple[float, ...]) -> None:
        """Pass MAV_CMD_INJECT_FAILURE on to the plant."""
        self._service.plant.inject_failure(parameters, self._now, self._finish)

    def restart(self, shut_down: bool) -> None:
        """Begin afresh, or end, once the acknowledgement is out."""
        self._service.restart = "shut down" if shut_down else "reboot"

    def say(self, text: str) -> None:
        """A STATUSTEXT that comes with an acceptance."""
        self._service.out.say(self._peer, Notice(INFO, text), self._now)


def _finite(command: Command) -> tuple[float, ...]:
    """The parameters as numbers that can be compared and packed."""
    numbers = (command.p1, command.p2, command.p3, command.p4, command.p5, command.p6, command.p7)
    return tuple(math.nan if math.isnan(number) else number for number in numbers)
