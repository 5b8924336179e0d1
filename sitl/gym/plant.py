"""The plant in this process, without a link: rotor controls in, truth and sensors out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from controller.hil.ticks import TickReader
from sitl_bridge.frames import fix_from_wire
from sitl_bridge.plant.lost_vehicle import is_lost
from sitl_bridge.plant.physics.state import Array
from sitl_bridge.plant.sensing import Diverged
from sitl_bridge.plant.simulation import Simulation
from sitl_bridge.plant.stages import Command
from sitl_bridge.vehicle.description import Vehicle

RATE_HZ = 250.0
"""Ticks a second."""
_FIX_3D = 3


class GymPlant:
    """One flight from a vehicle's initial state on."""

    def __init__(self, vehicle: Vehicle, seed: int, sense: bool) -> None:
        """sense: read the sensors' frames at each tick."""
        self.vehicle = vehicle
        self.lost = False
        """Whether the vehicle turned over, fell or ran away."""
        self.fix: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
        """Position (3,), m, and velocity (3,), m/s, of the last fix of GPS, ENU; None: there is none."""
        self.ticks_since_fix = 0
        self.ticks_since_sighting = 0
        self._simulation = Simulation(vehicle, RATE_HZ, seed)
        self._reader = TickReader(0) if sense else None
        self._sighted = 0
        self._simulation.datagram()
        self._simulation.heard()
        self._simulation.next_tick()
        self._simulation.datagram()
        self._simulation.begin()
        self._sense(self._simulation.datagram())

    @property
    def state(self) -> Array:
        """(19,), see `plant.physics.state`: a view."""
        return self._simulation.world.state

    @property
    def sensed(self) -> NDArray[np.void]:
        """The last record of `hil.ticks.SENSED`, shape (1,); only with `sense`."""
        assert self._reader is not None
        return self._reader.sensed

    @property
    def sighting(self) -> tuple[float, float, float] | None:
        """Where the tracker saw the load last, m, body FLU; None: it has not seen it, or there is none."""
        tracker = self._simulation.world.tracker
        return None if tracker is None or tracker.newest is None else tracker.newest.position

    @property
    def time_s(self) -> float:
        """Since the start."""
        return self._simulation.scenario_time

    def fly(self, controls: Array) -> None:
        """Fly a tick under rotor controls (16,), 0 to 1."""
        if self.lost:
            return
        self._simulation.fly_tick([Command(0, controls)])
        try:
            self._sense(self._simulation.datagram())
        except Diverged:
            self.lost = True

    def look(self) -> bool:
        """Look whether the vehicle is lost; it stays so."""
        self.lost = self.lost or not np.isfinite(self.state).all() or is_lost(self.vehicle, self.state)
        return self.lost

    def _sense(self, datagram: bytes) -> None:
        if self._reader is None:
            return
        tick = self._reader.read(datagram)
        self.ticks_since_fix += 1
        self.ticks_since_sighting += 1
        if tick.gps and self._reader.gps["fix_type"] >= _FIX_3D:
            position, velocity = fix_from_wire(self._reader.gps, self._simulation.origin)
            self.fix, self.ticks_since_fix = (np.array(position), np.array(velocity)), 0
        tracker = self._simulation.world.tracker
        if tracker is not None and tracker.arrived != self._sighted:
            self._sighted, self.ticks_since_sighting = tracker.arrived, 0
