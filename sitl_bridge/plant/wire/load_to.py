"""`--load-to`: the plant shows the load to a ground station itself, where the autopilot does not. No I/O."""

from __future__ import annotations

from sitl_bridge.frames import LocalOrigin
from sitl_bridge.ids import COMPONENT_LOAD, COMPONENT_TRUTH, load_system, vehicle_system
from sitl_bridge.mavlink.framing import Packer
from sitl_bridge.mavlink.traffic import load_traffic
from sitl_bridge.plant.physics.world import World
from sitl_bridge.plant.wire.slow_frames import (
    HEARTBEAT_INTERVAL,
    POSITION_INTERVAL,
    LoadOnMap,
    load_heartbeat,
)

HEARTBEAT_EVERY = round(HEARTBEAT_INTERVAL / POSITION_INTERVAL)


class LoadTo:
    """Datagrams for a ground station, at the pace of the wall clock, however simulated time runs."""

    def __init__(self, instance: int, origin: LocalOrigin) -> None:
        self._instance = instance
        self._map = LoadOnMap(origin)
        self._load = Packer(load_system(instance), COMPONENT_LOAD)
        # QGroundControl takes traffic only from the vehicle's system.
        self._vehicle = Packer(vehicle_system(instance), COMPONENT_TRUTH)
        self._next = 0.0
        self._count = 0

    def to_send(self, now: float, time_usec: int, world: World) -> bytes | None:
        """What is due: where the load is, and once a second that it is there."""
        if now < self._next:
            return None
        self._next = now + POSITION_INTERVAL
        position = self._map.global_position(time_usec, world.state)
        out = self._load.pack(position)
        if self._count % HEARTBEAT_EVERY == 0:
            traffic = load_traffic(self._instance, position)
            out = self._load.pack(load_heartbeat()) + out + self._vehicle.pack(traffic)
        self._count += 1
        return out
