"""The bare round trip of datagrams between two Python processes: what a lockstep tick is measured against.

`python -m sitl.benchmark.roundtrip ANSWER_SIZE` is the other process: it prints its port and echoes until
told to stop.
"""

from __future__ import annotations

import socket
import subprocess
import sys
import time

STOP = b""


def echo(answer_size: int) -> None:
    """Answer every datagram with one of `answer_size` bytes; an empty one ends it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as endpoint:
        endpoint.bind(("127.0.0.1", 0))
        print(endpoint.getsockname()[1], flush=True)
        answer = bytes(answer_size)
        while True:
            datagram, sender = endpoint.recvfrom(65536)
            if datagram == STOP:
                return
            endpoint.sendto(answer, sender)


def round_trip_us(request_size: int, answer_size: int, trips: int) -> float:
    """Time, us, from sending a datagram to having its answer from another process.

    The time of all trips over their number, as a tick's is of a flight: a machine's hiccups are in both.
    """
    command = [sys.executable, "-m", "sitl.benchmark.roundtrip", str(answer_size)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        peer = ("127.0.0.1", int(other.stdout.readline()))
        request = bytes(request_size)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as endpoint:
            endpoint.bind(("127.0.0.1", 0))
            began = time.perf_counter()
            for _ in range(trips):
                endpoint.sendto(request, peer)
                endpoint.recvfrom(65536)
            taken = time.perf_counter() - began
            endpoint.sendto(STOP, peer)
    return 1e6 * taken / trips


if __name__ == "__main__":
    echo(int(sys.argv[1]))
