"""Ports for processes that are launched next to whatever else runs."""

from __future__ import annotations

import contextlib
import random
import socket

FIRST, LAST = 20000, 32767
"""Below what systems hand out themselves.

A port that the system chose (bind to 0) is one that it may give to anyone who sends without a port of his
own, before the process that it was meant for has started.
"""


def free_ports(count: int, kind: socket.SocketKind = socket.SOCK_DGRAM) -> list[int]:
    """Ports on loopback that nobody has just now, UDP unless told. Raises OSError when there are too few."""
    chosen: list[int] = []
    with contextlib.ExitStack() as stack:
        for port in random.SystemRandom().sample(range(FIRST, LAST + 1), LAST + 1 - FIRST):
            candidate = stack.enter_context(socket.socket(socket.AF_INET, kind))
            with contextlib.suppress(OSError):
                candidate.bind(("127.0.0.1", port))
                chosen.append(port)
            if len(chosen) == count:
                return chosen
    raise OSError(f"{count} free ports from {FIRST} to {LAST}: there are only {len(chosen)}")
