"""Flights under ground control on the estimate, in one process: the plant's and the autopilot's own protocol
objects hand each other datagrams, in lockstep, on a clock of the simulation."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.feedback.estimate import EstimateFeedback
from controller.feedback.health import EstimateAssessor
from controller.ground.flight import client_requests
from controller.ground.flight.modes import Machine
from controller.ground.station import Station
from controller.ground.telemetry.vehicle_state import profile_of
from controller.hil.session import new_session
from controller.law.state import Array
from controller.pilot.guided.autopilot import GuidedAutopilot
from controller.pilot.guided.redesign import Redesigner
from sitl_bridge.plant.clocks.lockstep import Lockstep
from sitl_bridge.plant.faults.schedule import Faults
from sitl_bridge.plant.log.notices import Notices
from sitl_bridge.plant.simulation import Simulation
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import validated

RATE_HZ = 250.0
COLUMNS = ("time", "truth", "estimate")


class NoRedesign:
    """Weights stay as they are."""

    def request(self, emphasis: Any, rest_length: float) -> None:
        """Not asked for."""

    def result(self) -> None:
        """None."""


class GuidedFlight:
    """One vehicle with its autopilot and station; `fly(until)` advances it."""

    def __init__(
        self,
        vehicle: Vehicle,
        seed: int = 0,
        faults: dict[str, Any] | None = None,
        redesigner: Redesigner | None = None,
        told: Vehicle | None = None,
        after_tick: Callable[[], None] = lambda: None,
        **parameters: float,
    ) -> None:
        """redesigner: by default, gains stay as they are. told: the autopilot's description, by default the
        plant's."""
        self.vehicle = vehicle if told is None else told
        self._after_tick = after_tick
        self._redesigner = redesigner or NoRedesign()
        table = validated(Faults, faults or {}, "faults")
        self.simulation = Simulation(vehicle, RATE_HZ, seed, faults=table)
        self.plant = Lockstep(self.simulation, Notices(lambda text: None), 0)
        self.said: list[str] = []
        self.rows: list[tuple[float, NDArray[Any], NDArray[Any]]] = []
        self.start_controller(**parameters)
        self.now = 0.0
        self.plant.start(self.now)

    def start_controller(self, **parameters: float) -> None:
        """A controller that knows nothing of what was before."""
        self.feedback = EstimateFeedback(self.vehicle, RATE_HZ, say=self.said.append, only_good=False)
        self.station = Station(profile_of(self.vehicle, 0, self.vehicle.ground is not None), 0.0)
        for name, value in parameters.items():
            self.station.parameters.set(name, value)
        announce = self.station.announce

        def note(notice: Any, now: float) -> None:
            self.said.append(notice.text)
            announce(notice, now)

        self.station.announce = note  # type: ignore[method-assign]
        self.session = new_session(self._autopilot, 0, self.said.append, self.feedback)

    def _autopilot(self, controls: Array) -> GuidedAutopilot:
        self.pilot = GuidedAutopilot(
            self.vehicle, RATE_HZ, self.station, self._redesigner, controls, EstimateAssessor(self.feedback)
        )
        return self.pilot

    @property
    def machine(self) -> Machine:
        """Modes, missions, failsafes."""
        return self.station.machine

    def fly(self, condition: Callable[[], bool], seconds: float, what: str) -> None:
        """Advance until something holds; AssertionError after so many simulated seconds."""
        for _ in range(round(seconds * RATE_HZ)):
            if condition():
                return
            self._tick()
        raise AssertionError(f"{what}: not within {seconds:g} s; said {self.said[-8:]}")

    def wait(self, seconds: float) -> None:
        """Advance so long."""
        for _ in range(round(seconds * RATE_HZ)):
            self._tick()

    def _tick(self) -> None:
        self.now += 1.0 / RATE_HZ
        self.plant._due = min(self.plant._due, self.now)
        for datagram in self.plant.to_send(self.now):
            self.session.receive(datagram, self.now)
        for answer in self.session.to_send(self.now):
            self.plant.receive(answer, self.now)
        state = self.simulation.world.state
        estimate = np.array(self.feedback.estimator.state())
        self.rows.append((self.now, state.copy(), estimate))
        self._after_tick()

    def arm_and_take_off(self, height: float) -> None:
        """Wait until it can be armed, arm, take off, wait for Hold."""
        self.fly(lambda: not self.machine.arming_faults(), 10.0, "ready to arm")
        assert self.machine.arm(self.now).ok, self.machine.arming_faults()
        client_requests.takeoff(self.machine, height)
        self.fly(lambda: self.machine.mode.name == "HOLD" and self.machine.flying, 90.0, "hold")

    def truth(self) -> tuple[Array, Array]:
        """True positions of vehicle and load, m."""
        state = self.simulation.world.state
        return state[0:3].copy(), state[13:16].copy()

    def errors(self) -> Array:
        """Estimated minus true positions of vehicle and load (n, 6), m."""
        return np.array([np.r_[e[0:3] - s[0:3], e[3:6] - s[13:16]] for _, s, e in self.rows])

    def largest_tilt(self) -> float:
        """Of the vehicle, rad."""
        return max(math.acos(max(-1.0, 1 - 2 * (s[7] ** 2 + s[8] ** 2))) for _, s, _ in self.rows)
