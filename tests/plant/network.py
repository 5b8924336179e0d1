"""A network in memory between a plant's clock and an autopilot, in virtual time, as unkind as asked for."""

from __future__ import annotations

import heapq
import itertools
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from controller.hil.session import HilSession, new_session
from controller.law.reference import setpoint
from controller.pilot.autopilot import Autopilot
from sitl_bridge.plant.physics.world import World
from sitl_bridge.plant.simulation import Simulation
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle


class Endpoint(Protocol):
    def receive(self, datagram: bytes, now: float) -> None: ...
    def to_send(self, now: float) -> list[bytes]: ...
    def next_deadline(self) -> float: ...


@dataclass
class Rows:
    """A recorder that keeps everything in memory."""

    rows: list[np.ndarray[Any, Any]] = field(default_factory=list)
    table: None = None
    count: int = 0

    def took_row(self) -> None:
        raise AssertionError("there is no table")

    def record(self, time_s: float, world: World) -> None:
        self.rows.append(np.concatenate([[time_s], world.state, world.rotor_speed]))

    def bytes(self) -> bytes:
        return np.array(self.rows).tobytes()


@dataclass
class Faults:
    """What happens to datagrams on their way, each way."""

    drop: float = 0.0
    duplicate: float = 0.0
    delay_s: float = 50e-6
    jitter_s: float = 0.0
    seed: int = 0


class Network:
    """Carries datagrams between two endpoints; `run` goes on until a condition holds or time is up."""

    def __init__(self, plant: Endpoint, autopilot: Endpoint, faults: Faults) -> None:
        self.plant, self.autopilot = plant, autopilot
        self.now = 100.0
        self.sent: dict[str, list[bytes]] = {"plant": [], "autopilot": []}
        self._faults = faults
        self._random = random.Random(faults.seed)
        self._flying: list[tuple[float, int, str, bytes]] = []
        self._order = itertools.count()
        self.stalled: set[str] = set()
        """Endpoints that do nothing for now; what is sent to them waits in their socket."""

    def run(self, until: Callable[[], bool], longest_s: float = 1e4) -> None:
        end = self.now + longest_s
        while not until():
            assert self.now < end, "the run does not come to its end"
            self._send("plant", self.plant, "autopilot")
            self._send("autopilot", self.autopilot, "plant")
            arrivals = [entry for entry in self._flying if entry[2] not in self.stalled]
            times = [min(arrivals)[0]] if arrivals else []
            for name, endpoint in (("plant", self.plant), ("autopilot", self.autopilot)):
                if name not in self.stalled:
                    times.append(endpoint.next_deadline())
            self.now = max(self.now, min(min(times), end))
            arrived = sorted(entry for entry in arrivals if entry[0] <= self.now)
            if isinstance(self.autopilot, HilSession):  # as it is told by its loop
                self.autopilot.expect([entry[3] for entry in arrived if entry[2] == "autopilot"][1:])
            for entry in arrived:
                self._flying.remove(entry)
                getattr(self, entry[2]).receive(entry[3], self.now)

    def _send(self, name: str, endpoint: Endpoint, to: str) -> None:
        if name in self.stalled:
            return
        for datagram in endpoint.to_send(self.now):
            self.sent[name].append(datagram)
            copies = 2 if self._random.random() < self._faults.duplicate else 1
            for _ in range(copies):
                if self._random.random() >= self._faults.drop:
                    delay = self._faults.delay_s + self._random.random() * self._faults.jitter_s
                    heapq.heappush(self._flying, (self.now + delay, next(self._order), to, datagram))


def paper() -> Vehicle:
    return load_vehicle("paper", ["disturbance.force_std=5"])


def autopilot_session(
    vehicle: Vehicle, rate_hz: float = 250.0, say: Callable[[str], None] = lambda text: None
) -> HilSession:
    return new_session(
        lambda controls: Autopilot(
            vehicle, "default", rate_hz, lambda start: setpoint((1.0, 2.0, 1.0), start), controls
        ),
        0,
        say,
    )


def simulation(vehicle: Vehicle, duration_s: float | None, seed: int = 3) -> tuple[Simulation, Rows]:
    rows = Rows()
    return Simulation(vehicle, 250.0, seed, duration_s=duration_s, recorder=rows), rows
