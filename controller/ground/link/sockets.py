"""The two UDP sockets of the ground-control links, and nothing else: bytes between them and a `Station`."""

from __future__ import annotations

import contextlib
import ipaddress
import socket
from collections import deque

from controller.ground.link.peers import Address
from controller.ground.station import Station
from sitl_bridge.mavlink.framing import Frame

MOST_DATAGRAMS = 8
"""Datagrams read from a link in one call"""
MOST_BYTES = 2048
"""Bytes taken of a datagram; no client packs more frames into one, and what is beyond is lost"""
FRAMES_AT_ONCE = 16
"""Frames of a link taken in one call: a flood waits in the socket, not in front of the control loop"""


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
        self._waiting: list[deque[tuple[Frame, Address]]] = [deque() for _ in ports]
        """Of each link, the frames of its last datagram that wait for the next call"""
        try:
            for port in ports:
                link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                self.sockets.append(link)
                link.setblocking(False)
                link.bind((host, port))
        except OSError:
            self.close()
            raise

    def serve(self, station: Station, now: float) -> None:
        """Take in what has come, send what is due. Never blocks, and never fails for a peer that is gone."""
        for index in range(len(self.sockets)):
            self._take_in(index, station, now)
        for address, datagram in station.to_send(now):
            with contextlib.suppress(OSError):
                self.sockets[address.link].sendto(datagram, (address.host, address.port))

    def _take_in(self, index: int, station: Station, now: float) -> None:
        """Hand over what has come on a link, as much of it as one call may cost."""
        waiting = self._waiting[index]
        datagrams = frames = 0
        while frames < FRAMES_AT_ONCE:
            if waiting:
                station.receive_frame(*waiting.popleft(), now)
                frames += 1
            elif datagrams < MOST_DATAGRAMS:
                datagrams += 1
                try:
                    datagram, (host, port) = self.sockets[index].recvfrom(MOST_BYTES)
                except BlockingIOError:
                    return
                except OSError:
                    continue  # the peer of an earlier datagram is gone
                address = Address(index, host, port)
                waiting.extend((frame, address) for frame in station.datagrams.frames(datagram, address))
            else:
                return

    def close(self) -> None:
        """Close all."""
        for link in self.sockets:
            link.close()
