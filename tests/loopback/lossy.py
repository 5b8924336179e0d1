"""A UDP relay that loses datagrams, each way, between a client and a vehicle."""

from __future__ import annotations

import random
import select
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def lossy_relay(vehicle_port: int, loss: float, seed: int = 1) -> Iterator[int]:
    """A port on 127.0.0.1 whose datagrams go to the vehicle's, and back, but for a share that is lost."""
    chance, ended = random.Random(seed), threading.Event()
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as inward,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as outward,
    ):
        inward.bind(("127.0.0.1", 0))
        outward.connect(("127.0.0.1", vehicle_port))

        def run() -> None:
            client = None
            while not ended.is_set():
                for ready in select.select([inward, outward], [], [], 0.1)[0]:
                    try:
                        datagram, sender = ready.recvfrom(65535)
                    except ConnectionError:
                        continue  # nobody there yet, or no more
                    if ready is inward:
                        client = sender
                    if chance.random() < loss:
                        continue
                    if ready is inward:
                        outward.send(datagram)
                    elif client is not None:
                        inward.sendto(datagram, client)

        thread = threading.Thread(target=run)
        thread.start()
        try:
            yield int(inward.getsockname()[1])
        finally:
            ended.set()
            thread.join()
