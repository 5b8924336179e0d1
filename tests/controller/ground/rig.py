"""A station, the kinematic vehicle and clients on lossy channels; time is simulated."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.files.logs import LogStore
from controller.ground.link.peers import Address
from controller.ground.link.signing import Signing
from controller.ground.parameters.file import ParameterFile
from controller.ground.station import Station
from controller.ground.telemetry.vehicle_state import Profile, VehicleView
from sitl_bridge.mavlink.framing import Packer, decode, split
from tests.controller.ground.kinematic import PROFILE, grounded_view, step

TICK = 0.02
NAN = math.nan


@dataclass
class Channel:
    """What a link does to datagrams, each way, seeded."""

    loss: float = 0.0
    duplication: float = 0.0
    reordering: float = 0.0
    seed: int = 1
    _random: random.Random = field(init=False)

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)

    def carry(self, datagrams: list[bytes]) -> list[bytes]:
        """The datagrams that arrive, in the order they do."""
        out: list[bytes] = []
        for datagram in datagrams:
            if self._random.random() < self.loss:
                continue
            copies = 2 if self._random.random() < self.duplication else 1
            for _ in range(copies):
                late = self._random.random() < self.reordering
                out.insert(len(out) - 1 if late and out else len(out), datagram)
        return out


class Client:
    """A ground station without opinions: it sends messages and keeps what it gets."""

    def __init__(
        self, rig: Rig, port: int, link: int = 0, system: int = 255, channel: Channel | None = None
    ) -> None:
        self.rig = rig
        self.address = Address(link, "127.0.0.1", port)
        self.system, self.component = system, 190
        self.channel = channel or Channel()
        self.packer = Packer(system, self.component)
        self.inbox: list[Any] = []
        self.raw: list[bytes] = []

    def send(self, *messages: Any) -> None:
        """Send messages through the channel."""
        self.send_raw(*(self.packer.pack(message) for message in messages))

    def send_raw(self, *datagrams: bytes) -> None:
        """Send bytes through the channel."""
        for datagram in self.channel.carry(list(datagrams)):
            self.rig.station.receive(datagram, self.address, self.rig.now)

    def take(self, datagrams: list[bytes]) -> None:
        """Datagrams from the vehicle."""
        for datagram in self.channel.carry(datagrams):
            self.raw.append(datagram)
            self.inbox += [decode(frame) for frame in split(datagram).frames]

    def got(self, kind: str) -> list[Any]:
        """Messages of a type, so far."""
        return [message for message in self.inbox if message.get_type() == kind]

    def clear(self) -> None:
        """Forget what has come."""
        self.inbox.clear()
        self.raw.clear()

    def texts(self) -> list[str]:
        """STATUSTEXTs, pieces joined."""
        out: list[str] = []
        for message in self.got("STATUSTEXT"):
            if message.id and message.chunk_seq:
                out[-1] += message.text
            else:
                out.append(message.text)
        return out

    def command(
        self, number: int, *params: float, confirmation: int = 0, target: tuple[int, int] = (1, 1)
    ) -> Any:
        """Send a COMMAND_LONG, wait for its acknowledgement; exactly one has to come."""
        values = [*params, *[NAN] * (7 - len(params))]
        return self.ask(mavlink.MAVLink_command_long_message(*target, number, confirmation, *values))

    def command_int(
        self, number: int, params: tuple[float, ...], x: int, y: int, z: float, frame: int = 0
    ) -> Any:
        """The same with COMMAND_INT."""
        return self.ask(mavlink.MAVLink_command_int_message(1, 1, frame, number, 0, 0, *params, x, y, z))

    def ask(self, message: Any) -> Any:
        """Send a command, return its one acknowledgement."""
        before = len(self.got("COMMAND_ACK"))
        self.send(message)
        self.rig.run(2 * TICK)
        acks = self.got("COMMAND_ACK")[before:]
        assert len(acks) == 1, acks
        assert (acks[0].target_system, acks[0].target_component) == (self.system, self.component)
        assert acks[0].command == message.command
        return acks[0]

    def heartbeat(self) -> None:
        """Say that we are a ground station."""
        self.send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))


class Rig:
    """Everything at one time."""

    def __init__(
        self,
        profile: Profile = PROFILE,
        storage: ParameterFile | None = None,
        signing: Signing | None = None,
        view: VehicleView | None = None,
        logs: LogStore | None = None,
    ) -> None:
        self.now = 100.0
        self.profile = profile
        self.station = Station(profile, self.now, storage, signing, logs=logs)
        self.view = view or grounded_view()
        self.clients: list[Client] = []
        self.target: Any = None
        self.frozen = False
        self.before_step: Callable[[], None] = lambda: None

    def client(self, port: int = 14550, **options: Any) -> Client:
        """A new client."""
        made = Client(self, port, **options)
        self.clients.append(made)
        return made

    def run(self, seconds: float) -> None:
        """Let time pass."""
        for _ in range(round(seconds / TICK)):
            self.now += TICK
            self.before_step()
            self.target = self.station.update(self.view, self.now)
            if not self.frozen:
                step(self.view, self.target, TICK, self.profile)
            by_address: dict[Address, list[bytes]] = {}
            for address, datagram in self.station.to_send(self.now):
                by_address.setdefault(address, []).append(datagram)
            for client in self.clients:
                client.take(by_address.get(client.address, []))

    def run_until(self, holds: Callable[[], bool], timeout: float = 60.0) -> None:
        """Let time pass until something is true."""
        end = self.now + timeout
        while not holds():
            assert self.now < end, f"not within {timeout:g} s; {self.station.machine.mode} {self.target}"
            self.run(TICK)

    def fly(self, client: Client) -> None:
        """Arm, take off and wait for HOLD."""
        self.run(0.1)
        assert client.command(400, 1).result == 0, client.texts()
        assert client.command(22).result == 0, client.texts()
        self.run_until(lambda: self.station.machine.stage.name == "FLYING")
