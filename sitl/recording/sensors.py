"""What the sensors said in a flight, from its telemetry log: HIL_SENSOR and HIL_GPS as columns."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.mavlink.framing import Frame, split
from sitl_bridge.mavlink.hil import HIL_ACTUATOR_CONTROLS, HIL_GPS, HIL_SENSOR, MODE_FLAG_ARMED, Layout
from sitl_bridge.mavlink.tlog import TIMESTAMP_SIZE

Records = NDArray[np.void]
_LEAST_FRAME = 8
"""Bytes of the shortest MAVLink frame; less behind a time stamp is the end of a log that was cut off."""


def frames(tlog: Path) -> Iterator[tuple[float, Frame]]:
    """Every whole frame of a telemetry log behind its Unix time in s. A log that was cut off just ends."""
    data = tlog.read_bytes()
    at = 0
    while at + TIMESTAMP_SIZE + _LEAST_FRAME <= len(data):
        time_usec = int.from_bytes(data[at : at + TIMESTAMP_SIZE], "big")
        start = at + TIMESTAMP_SIZE
        stop = start + _frame_length(data, start)
        found = split(data[start:stop]).frames
        if found:
            yield time_usec * 1e-6, found[0]
        at = stop


def _frame_length(data: bytes, start: int) -> int:
    """Of a version 2 frame, with its signature; of a version 1 frame otherwise."""
    payload = data[start + 1]
    if data[start] == 0xFD:
        return 12 + payload + (13 if data[start + 2] & 1 else 0)
    return 8 + payload


class SensorLog(NamedTuple):
    """Sensors of one flight. Records in wire units and NED/FRD, each tick once, in order of time."""

    sensors: Records
    """HIL_SENSOR."""
    sensor_times: NDArray[np.float64]
    """s since the scenario began."""
    fixes: Records
    """HIL_GPS."""
    fix_times: NDArray[np.float64]


def read_sensors(tlog: Path) -> SensorLog:
    """Everything that the plant's sensors said from the first armed answer on."""
    payloads: dict[int, list[bytes]] = {HIL_SENSOR.message_id: [], HIL_GPS.message_id: []}
    begin: int | None = None
    for _, frame in frames(tlog):
        if frame.message_id in payloads:
            payloads[frame.message_id].append(frame.payload)
        elif begin is None and frame.message_id == HIL_ACTUATOR_CONTROLS.message_id:
            answer = _records([frame.payload], HIL_ACTUATOR_CONTROLS)[0]
            if answer["mode"] & MODE_FLAG_ARMED:
                begin = int(answer["time_usec"])
    found: list[Any] = []
    for layout in (HIL_SENSOR, HIL_GPS):
        records = _records(payloads[layout.message_id], layout)
        _, first = np.unique(records["time_usec"], return_index=True)
        records = records[first]
        records = records[records["time_usec"] >= (begin or 0)]
        found += [records, (records["time_usec"].astype(np.float64) - (begin or 0)) * 1e-6]
    return SensorLog(*found)


def _records(payloads: list[bytes], layout: Layout) -> Records:
    size = layout.dtype.itemsize
    return np.frombuffer(b"".join(p.ljust(size, b"\0")[:size] for p in payloads), dtype=layout.dtype)
