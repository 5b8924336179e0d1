"""A station behind real sockets with the kinematic vehicle: for checks against real clients, no simulation.

`python -m tests.ground.served [--seconds S] [--local A B] [--remote C D]` serves one until killed.
"""

from __future__ import annotations

import argparse
import select
import time

from controller.ground.peers import Address
from controller.ground.sockets import GroundSockets
from controller.ground.station import Station
from sitl_bridge.mavlink.framing import Packer, split
from tests.ground.kinematic import PROFILE, grounded_view, step


def serve(seconds: float, local: tuple[int, int], remote: tuple[int, int], speed: float = 1.0) -> None:
    """Run for so many seconds; `speed` is how much faster than real time the vehicle moves."""
    from pymavlink.dialects.v20 import common as mavlink

    now = time.monotonic()
    peers = tuple(Address(link, "127.0.0.1", port) for link, port in enumerate(remote))
    station = Station(PROFILE, now, peers=peers)
    links = GroundSockets(local)
    view = grounded_view()
    load = Packer(PROFILE.load_system, 35)
    end = now + seconds
    tick = 0
    try:
        while now < end:
            target = station.update(view, now)
            step(view, target, 0.02 * speed)
            if tick % 10 == 0:
                place = PROFILE.origin.geodetic(view.load_position)
                for message in (
                    mavlink.MAVLink_heartbeat_message(7, 8, 0, 0, 4, 3),
                    mavlink.MAVLink_global_position_int_message(
                        int(view.time * 1000),
                        int(place.latitude * 1e7),
                        int(place.longitude * 1e7),
                        int(place.altitude * 1000),
                        int(view.load_position[2] * 1000),
                        *(0, 0, 0, 0),
                    ),
                ):
                    for frame in split(load.pack(message)).frames:
                        station.hear_plant(frame, now)
            tick += 1
            deadline = now + 0.02
            while (now := time.monotonic()) < deadline:
                links.exchange(station, now)
                select.select(
                    links.sockets, [], [], max(0.0, min(deadline, station.next_deadline(now)) - now)
                )
    finally:
        links.close()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=3600)
    parser.add_argument("--local", type=int, nargs=2, default=(18570, 14580))
    parser.add_argument("--remote", type=int, nargs=2, default=(14550, 14540))
    parser.add_argument("--speed", type=float, default=1.0)
    given = parser.parse_args()
    serve(given.seconds, tuple(given.local), tuple(given.remote), given.speed)
