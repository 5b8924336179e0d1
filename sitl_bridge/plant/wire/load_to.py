"""`--load-to`: the plant shows the load to a ground station itself, where the autopilot does not. No I/O."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sitl_bridge.frames import LocalOrigin
from sitl_bridge.ids import COMPONENT_LOAD, COMPONENT_TRUTH, load_system, vehicle_system
from sitl_bridge.mavlink.framing import Packer
from sitl_bridge.mavlink.traffic import load_traffic
from sitl_bridge.plant.physics.world import World
from sitl_bridge.plant.wire.slow_frames import (
    HEARTBEAT_INTERVAL,
    LoadOnMap,
    landing_target,
    load_heartbeat,
)

if TYPE_CHECKING:
    from sitl_bridge.plant.simulation import Simulation

POSITION_INTERVAL = 0.1
"""s, by the wall clock: as ArduPilot's slung-load script has it."""
HEARTBEAT_EVERY = round(HEARTBEAT_INTERVAL / POSITION_INTERVAL)


class LoadTo:
    """Datagrams for a ground station or a companion, at the pace of the wall clock.

    Where the load is, once a second that it is there, and what a tracker sees of it.
    """

    def __init__(self, instance: int, origin: LocalOrigin) -> None:
        self._instance = instance
        self._map = LoadOnMap(origin)
        self._load = Packer(load_system(instance), COMPONENT_LOAD)
        # QGroundControl takes traffic only from the vehicle's system.
        self._vehicle = Packer(vehicle_system(instance), COMPONENT_TRUTH)
        self._next = 0.0
        self._count = 0
        self._seen = 0

    def to_send(self, now: float, simulation: Simulation) -> bytes | None:
        """What is due."""
        time_usec, world = simulation.time_usec, simulation.world
        out = self._sighting(time_usec, world)
        if now >= self._next:
            self._next = now + POSITION_INTERVAL
            position = self._map.global_position(time_usec, world.state)
            if self._count % HEARTBEAT_EVERY == 0:
                traffic = load_traffic(self._instance, position)
                out += self._load.pack(load_heartbeat()) + self._vehicle.pack(traffic)
            out += self._load.pack(position)
            self._count += 1
        return out or None

    def _sighting(self, time_usec: int, world: World) -> bytes:
        tracker = world.tracker
        if tracker is None or tracker.newest is None or tracker.arrived == self._seen:
            return b""
        self._seen = tracker.arrived
        return self._vehicle.pack(landing_target(time_usec, tracker.newest))
