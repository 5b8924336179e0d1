"""The UDP socket on which ground stations and scripts reach the load."""

from __future__ import annotations

import contextlib
import socket

Address = tuple[str, int]

SILENCE = 30.0
"""s after which a client that says nothing is forgotten."""
MOST_CLIENTS = 16
MOST_DATAGRAMS = 8
"""Taken at once: a flood waits in the socket."""


class LoadLink:
    """Speaks to a ground station first, and then also to whoever has spoken."""

    def __init__(self, local: int, peer: int) -> None:
        """Ports of 127.0.0.1: our own, and whom it speaks to first. Raises OSError."""
        self._peer: Address = ("127.0.0.1", peer)
        self._heard: dict[Address, float] = {}
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind(("127.0.0.1", local))
        except OSError as error:
            self._socket.close()
            raise OSError(f"UDP port {local} for the load cannot be opened: {error.strerror}") from None

    def receive(self, now: float) -> list[bytes]:
        """What has come."""
        out = []
        for _ in range(MOST_DATAGRAMS):
            try:
                datagram, client = self._socket.recvfrom(2048)
            except BlockingIOError:
                break
            except OSError:
                continue  # the peer of an earlier datagram is gone
            if client in self._heard or len(self._heard) < MOST_CLIENTS:
                self._heard[client] = now
            out.append(datagram)
        return out

    def send(self, datagrams: list[bytes], now: float) -> None:
        """To every client."""
        self._heard = {client: at for client, at in self._heard.items() if now - at < SILENCE}
        for client in {self._peer, *self._heard}:
            for datagram in datagrams:
                with contextlib.suppress(OSError):
                    self._socket.sendto(datagram, client)

    def close(self) -> None:
        """Free the port."""
        self._socket.close()
