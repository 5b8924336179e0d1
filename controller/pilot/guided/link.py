"""A controller's links to ground control: a station and its sockets."""

from __future__ import annotations

import time
from collections.abc import Callable

from controller.ground.link.peers import Address
from controller.ground.link.ports import ONBOARD_LINK, STATION_LINK
from controller.ground.link.signing import Signing, read_key
from controller.ground.link.sockets import GroundSockets
from controller.ground.parameters.file import ParameterFile
from controller.ground.station import Station, local_ports, standard_peers
from controller.ground.telemetry.vehicle_state import profile_of
from controller.pilot.guided.log_folder import LogFolder
from controller.pilot.guided.options import GroundOptions, Ports
from sitl_bridge.vehicle.description import Vehicle

LOOPBACK, EVERYWHERE = "127.0.0.1", "0.0.0.0"


class GroundLink:
    """A station with its sockets open."""

    def __init__(
        self,
        vehicle: Vehicle,
        instance: int,
        options: GroundOptions,
        say: Callable[[str], None],
        on_statustext: Callable[[str], None] = lambda text: None,
    ) -> None:
        """say: takes lines for a person; on_statustext: takes what goes to every ground station.

        Raises OSError when a port is taken, KeyFileError for a key that is none."""
        local, first = local_ports(instance), standard_peers(instance)
        given = (options.stations, options.onboard)
        ports = [
            Ports(own, peer.port) if asked is None else asked
            for asked, own, peer in zip(given, local, first, strict=True)
        ]
        peers = tuple(
            Address(link, LOOPBACK, port.peer)
            for link, port in zip((STATION_LINK, ONBOARD_LINK), ports, strict=True)
        )
        signing = None
        if options.signing_key is not None:
            signing = Signing(read_key(options.signing_key), time.time() - time.monotonic())
        storage = None if options.parameters is None else ParameterFile(options.parameters)
        host = EVERYWHERE if options.exposed else LOOPBACK
        try:
            self._sockets = GroundSockets(tuple(port.local for port in ports), host, options.exposed)
        except OSError as error:
            numbers = " and ".join(str(port.local) for port in ports)
            raise OSError(f"ground control's UDP ports {numbers}: {error.strerror or error}") from None
        profile = profile_of(vehicle, instance, has_ground=vehicle.ground is not None)
        logs = None if options.logs is None else LogFolder(options.logs)
        self.station = Station(profile, time.monotonic(), storage, signing, peers, logs, on_statustext)
        self._signing = signing
        # Of the parameter file; clients may attach too late for them.
        for notice in self.station.machine.notices:
            say(f"warning: {notice.text}")
        if options.exposed:
            guard = (
                "to whoever has the signing key" if signing else "to ANYBODY on the network, without a key"
            )
            say(f"warning: --expose opens the ground-control links {guard}")
        stations, onboard = ports
        say(f"ground stations: this end {host}:{stations.local}, listen on udp:{LOOPBACK}:{stations.peer}")
        say(
            f"MAVSDK and companions: this end {host}:{onboard.local}, listen on udpin://{LOOPBACK}:{onboard.peer}"
        )

    def serve(self, now: float) -> None:
        """Take in what has come, send what is due."""
        if self._signing is not None:
            self._signing.keep_time(now, time.time())
        self._sockets.serve(self.station, now)

    def close(self) -> None:
        """Free the ports."""
        self._sockets.close()
