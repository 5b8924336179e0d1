"""The real plant and the real autopilot in one process, in simulated time, with clients of the station."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.design.catalogue import Emphasis, guided_designs, on_cable
from controller.feedback.delay_watch import DelayWatch
from controller.feedback.truth import TruthFeedback
from controller.ground.flight.guidance import Stage
from controller.ground.link.peers import Address
from controller.ground.station import Station
from controller.ground.telemetry.vehicle_state import profile_of
from controller.hil.session import new_session
from controller.law.control_law import Design
from controller.pilot.guided.autopilot import GuidedAutopilot
from sitl_bridge.plant.clocks.lockstep import Lockstep
from sitl_bridge.plant.log.notices import Notices
from sitl_bridge.plant.physics.state import LOAD_POSITION as PLANT_LOAD
from sitl_bridge.plant.physics.state import VEHICLE_POSITION as PLANT_VEHICLE
from sitl_bridge.plant.simulation import Simulation
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.ground.rig import Client
from tests.loopback import swing

RATE_HZ = 250.0
Array = NDArray[np.float64]


class Designer:
    """Designs at once and hands out later, as a process in the background would."""

    def __init__(self, vehicle: Vehicle, delay_ticks: int = 250) -> None:
        self._vehicle = vehicle
        self._delay = delay_ticks
        self._ready: tuple[Design, Design] | None = None
        self._left = 0

    def request(self, emphasis: Emphasis, rest_length: float) -> None:
        """Begin to design."""
        self._ready = guided_designs(on_cable(self._vehicle, rest_length), RATE_HZ, emphasis)
        self._left = self._delay

    def result(self) -> tuple[Design, Design] | str | None:
        """The designs, when their time has come."""
        self._left -= 1
        if self._ready is None or self._left > 0:
            return None
        ready, self._ready = self._ready, None
        return ready


class Flown:
    """One vehicle; has what `rig.Client` needs of a rig."""

    def __init__(self, *overrides: str, vehicle: str = "iris", untold: tuple[str, ...] = ()) -> None:
        """untold: overrides of which only the plant knows."""
        self.vehicle = load_vehicle(vehicle, overrides)
        self.said: list[str] = []
        self.now = 100.0
        self.profile = profile_of(self.vehicle, 0, self.vehicle.ground is not None)
        self.station = Station(self.profile, self.now)
        self.clients: list[Client] = []
        self.every_tick: Callable[[], None] = lambda: None
        """Called before each tick"""
        flown = load_vehicle(vehicle, [*overrides, *untold])
        self.simulation = Simulation(flown, RATE_HZ, seed=1)
        feedback = TruthFeedback(DelayWatch(self.vehicle, RATE_HZ))
        self.session = new_session(self._autopilot, 0, self.said.append, feedback)
        self.clock = Lockstep(self.simulation, Notices(lambda text: None), 0)
        self.clock.start(self.now)
        self._track: list[list[float]] = []

    def _autopilot(self, controls: Array) -> GuidedAutopilot:
        self.pilot = GuidedAutopilot(self.vehicle, RATE_HZ, self.station, Designer(self.vehicle), controls)
        return self.pilot

    def client(self, port: int = 14550, **options: Any) -> Client:
        """A new client."""
        made = Client(self, port, **options)  # type: ignore[arg-type]
        self.clients.append(made)
        return made

    def tick(self) -> None:
        """One tick in lockstep."""
        self.now += self.simulation.period
        self.every_tick()
        for tick in self.clock.to_send(self.now):
            self.session.receive(tick, self.now)
        for answer in self.session.to_send(self.now):
            self.clock.receive(answer, self.now)
        if self.simulation.started:
            x = self.simulation.world.state
            self._track.append([self.simulation.scenario_time, *x[PLANT_VEHICLE], *x[PLANT_LOAD]])
        by_address: dict[Address, list[bytes]] = {}
        for address, datagram in self.station.to_send(self.now):
            by_address.setdefault(address, []).append(datagram)
        for client in self.clients:
            client.take(by_address.get(client.address, []))

    def run(self, seconds: float) -> None:
        """Let time pass."""
        for _ in range(max(1, round(seconds * RATE_HZ))):
            self.tick()

    def run_until(self, holds: Callable[[], bool], timeout: float = 60.0) -> None:
        """Let time pass until something is true."""
        end = self.now + timeout
        while not holds():
            assert self.now < end, f"not within {timeout:g} s; {self.station.machine.mode}"
            self.tick()

    def take_off(self, client: Client, timeout: float = 60.0) -> None:
        """Arm, take off and wait until the load hangs and is controlled."""
        self.run(0.5)
        assert client.command(400, 1).result == 0, client.texts()
        assert client.command(22).result == 0, client.texts()
        self.run_until(lambda: self.station.machine.stage is Stage.FLYING, timeout)

    def flown(self, seconds: float) -> swing.Flown:
        """The last part of the flight, by the plant's truth."""
        rows = np.array(self._track[-round(seconds * RATE_HZ) :])
        return swing.Flown(rows[:, 0], rows[:, 1:4], rows[:, 4:7])
