"""Companions over the real autopilot with the real plant, in one process.

The protocol objects of all three hand each other datagrams in lockstep, on the simulation's clock: a busy
machine makes no flight another.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pymavlink.dialects.v20 import common as mavlink

from controller.feedback.truth import PathFrom
from controller.ground.link.peers import Address
from controller.ground.station import ONBOARD_LINK, STATION_LINK
from controller.law.state import Array
from controller.over.ages import Ages
from controller.over.companion import Companion
from controller.over.flight import Flight
from controller.over.identify.probe import Probe
from controller.over.load.filtered import load_source
from controller.over.load.source import TruthSource
from controller.over.model import Steering
from controller.over.run import Live
from controller.over.stack import Stack
from controller.over.states import State
from sitl_bridge.frames import LocalOrigin
from sitl_bridge.mavlink.framing import Packer
from sitl_bridge.plant.physics.state import LOAD_POSITION, VEHICLE_POSITION
from sitl_bridge.plant.wire.truth_to import TruthTo
from sitl_bridge.vehicle.files import load_vehicle
from tests.estimator.guided import GuidedFlight

COMPANION = Address(ONBOARD_LINK, "127.0.0.1", 14540)
OPERATOR = Address(STATION_LINK, "127.0.0.1", 14550)


class FlownOver:
    """Plant, and autopilot on its estimate; companions, one after the other."""

    def __init__(self, *only_plant: str, sensors: str = "rtk", seed: int = 0) -> None:
        """only_plant: overrides of which autopilot and companions know nothing."""
        told = (f"sensors.preset={sensors}", "initial.start=ground")
        self.told = load_vehicle("iris", told)
        flown = load_vehicle("iris", [*told, *only_plant])
        self.stack = GuidedFlight(flown, seed, told=self.told, after_tick=self._exchange)
        home = flown.home
        self._truth = TruthTo(0, LocalOrigin(home.latitude, home.longitude, home.altitude))
        self._operator = Packer(245, 190)
        self.companion: Companion | None = None
        self._live: Live | None = None
        self.said: list[str] = []
        """By the companion that flies, or has flown last."""
        self.rows: list[tuple[float, Array, Array]] = []
        """Of the reference: time (s), true places of load and vehicle (3,), m."""

    def start(
        self,
        path_from: PathFrom,
        duration_s: float,
        probe: Probe | None = None,
        live: Live | None = None,
        load: str = "truth",
        steering: Steering = Steering.RATES,
    ) -> Flight:
        """A companion that knows nothing of what was before, in the place of another."""
        source, self.said = load_source(load, self.told), []
        ages = Ages(lambda: source.time_s if isinstance(source, TruthSource) else self.stack.now)
        flight = Flight(
            self.told,
            Stack(),
            source,
            path_from,
            duration_s,
            self.said.append,
            probe=probe,
            ages=ages,
            live=None if live is None else live.reference,
            steering=steering,
        )
        self.companion, self._live = Companion(flight), live
        return flight

    def run_until(self, holds: Callable[[], bool], seconds: float, what: str) -> None:
        """Advance until something is true; AssertionError after so many simulated seconds."""
        over = self.companion
        self.stack.fly(lambda: holds() or (over is not None and over.over), seconds, what)
        assert holds(), (what, self.said)

    def flight(self) -> tuple[Array, Array, Array]:
        """Of the reference: times since its begin (n,), true places of load and vehicle (n, 3)."""
        times, load, vehicle = (np.array(column) for column in zip(*self.rows, strict=True))
        return times - times[0], load, vehicle

    def operator_takes(self, mode: tuple[int, int]) -> None:
        """DO_SET_MODE of somebody at a ground station."""
        nan = float("nan")
        message = mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1.0, *mode, *(nan,) * 4)
        self.stack.station.receive(self._operator.pack(message), OPERATOR, self.stack.now)

    def _exchange(self) -> None:
        """What the links carry in a tick."""
        now, station, companion = self.stack.now, self.stack.station, self.companion
        truth = self._truth.to_send(now, self.stack.simulation)
        heard = [datagram for address, datagram in station.to_send(now) if address == COMPANION]
        if companion is None:
            return
        for datagram in [*([] if truth is None else [truth]), *heard]:
            companion.receive(datagram, now)
        for datagram in companion.to_send(now):
            station.receive(datagram, COMPANION, now)
        if self._live is not None:
            self._live.turn(companion.flight, now)
        if companion.flight.state is State.FLYING:
            x = self.stack.simulation.world.state
            self.rows.append((now, x[LOAD_POSITION].copy(), x[VEHICLE_POSITION].copy()))
