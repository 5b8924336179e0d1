"""A link that loses, delays, doubles, reorders and stalls: datagrams in, datagrams out later. No I/O."""

from __future__ import annotations

import heapq
from collections.abc import Sequence

from sitl_bridge.plant.faults.schedule import LinkFault
from sitl_bridge.plant.random_streams import stream


class FaultyPath:
    """One direction of the link. Times are in seconds of whatever clock the faults are timed in."""

    def __init__(self, faults: Sequence[LinkFault], direction: str, seed: int) -> None:
        """direction: `to_autopilot` or `to_plant`."""
        self._faults = [fault for fault in faults if fault.direction in ("both", direction)]
        # A stream each, named by its number among its kind: what one fault draws changes no other.
        kinds = [fault.failure for fault in self._faults]
        self._draws = [
            stream(seed, f"link.{direction}.{kind}.{kinds[:index].count(kind)}")
            for index, kind in enumerate(kinds)
        ]
        self._queue: list[tuple[float, int, bytes]] = []
        self._count = 0

    def receive(self, datagram: bytes, now: float) -> None:
        """Take a datagram that was sent now."""
        arrival, echo, lost = now, None, False
        for fault, draw in zip(self._faults, self._draws, strict=True):
            end = float("inf") if fault.duration is None else fault.at + fault.duration
            if not fault.at <= now < end or draw.random() >= fault.share:
                continue
            match fault.failure:
                case "drop":
                    lost = True  # the others draw nevertheless, so that they go on as they would without it
                case "delay" | "reorder":  # with a share below 1, later datagrams overtake this one
                    arrival += fault.delay
                case "jitter":
                    arrival += fault.delay * float(draw.random())
                case "duplicate":
                    echo = fault.delay
                case "stall":
                    arrival = max(arrival, end)
        if lost:
            return
        self._put(arrival, datagram)
        if echo is not None:
            self._put(arrival + echo, datagram)

    def to_send(self, now: float) -> list[bytes]:
        """Datagrams that arrive by now, in the order of their arrival."""
        out = []
        while self._queue and self._queue[0][0] <= now:
            out.append(heapq.heappop(self._queue)[2])
        return out

    def next_deadline(self) -> float | None:
        """When the next datagram arrives; None: nothing is under way, or nothing ever will arrive."""
        return self._queue[0][0] if self._queue and self._queue[0][0] < float("inf") else None

    def _put(self, arrival: float, datagram: bytes) -> None:
        heapq.heappush(self._queue, (arrival, self._count, datagram))
        self._count += 1
