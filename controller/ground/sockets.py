"""The two UDP sockets of the ground-control links, and nothing else: bytes between them and a `Station`."""

from __future__ import annotations

import contextlib
import ipaddress
import socket

from controller.ground.peers import Address
from controller.ground.station import Station

MOST_DATAGRAMS = 8
"""Datagrams read at once from a link: a flood waits in the socket, not in front of the control loop"""


class BindError(ValueError):
    """The links would be open to the network without a key."""


class GroundSockets:
    """Non-blocking sockets, one a link. `fileno`s are for the loop's own `select`."""

    def __init__(self, ports: tuple[int, ...], host: str = "127.0.0.1", exposed: bool = False) -> None:
        if not (exposed or ipaddress.ip_address(host).is_loopback):
            raise BindError(
                f"{host} is not this machine alone; say so explicitly, and better use a signing key"
            )
        self.sockets: list[socket.socket] = []
        try:
            for port in ports:
                link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                self.sockets.append(link)
                link.setblocking(False)
                link.bind((host, port))
        except OSError:
            self.close()
            raise

    def exchange(self, station: Station, now: float) -> None:
        """Take in what has come, send what is due. Never blocks, and never fails for a peer that is gone."""
        for index, link in enumerate(self.sockets):
            for _ in range(MOST_DATAGRAMS):
                try:
                    datagram, (host, port) = link.recvfrom(65535)
                except BlockingIOError:
                    break
                except OSError:
                    continue  # the peer of an earlier datagram is gone
                station.receive(datagram, Address(index, host, port), now)
        for address, datagram in station.to_send(now):
            with contextlib.suppress(OSError):
                self.sockets[address.link].sendto(datagram, (address.host, address.port))

    def close(self) -> None:
        """Close all."""
        for link in self.sockets:
            link.close()
