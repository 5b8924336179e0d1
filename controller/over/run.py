"""The companion's process: the stack's link, the truth's link where there is one, and one loop."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from controller.feedback.truth import PathFrom
from controller.law.state import Array
from controller.over.load_source import load_source
from controller.over.session import Companion, State
from controller.over.stack import Stack
from sitl_bridge.mavlink.links import Address, Link, open_link
from sitl_bridge.process import Speaker, StopRequest
from sitl_bridge.rowlog import RowLog
from sitl_bridge.vehicle.description import Vehicle

LOG_NAME = "companion.parquet"
LOG_COLUMNS = (
    "time_s",
    *(f"{body}_{axis}_m" for body in ("vehicle", "load") for axis in "xyz"),
    *(f"{body}_v{axis}_m_s" for body in ("vehicle", "load") for axis in "xyz"),
    *(f"body_rate_{axis}_rad_s" for axis in "pqr"),
    *(f"{angle}_rad" for angle in ("roll", "pitch", "yaw")),
    *(f"reference_{axis}_m" for axis in "xyz"),
)


@dataclass(frozen=True)
class OverOptions:
    """What a companion is started with."""

    vehicle: Vehicle
    over: Address
    """The stack's link."""
    path_from: PathFrom
    duration_s: float
    stack: Stack = field(default_factory=Stack)
    load: str = "none"
    """Where the load is known from: truth, position or none."""
    truth: Address | None = None
    """Link on which the plant's truth comes; with load = truth."""
    out: Path | None = None


def run(options: OverOptions, speaker: Speaker, stop: StopRequest) -> dict[str, Any]:
    """Fly once over a stack; returns what to report of it. Raises OSError when a link cannot be opened."""
    link = open_link(options.over, speaker.say, punctual=True)
    truth = None if options.truth is None else open_link(options.truth, speaker.say)
    log = None
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        log = RowLog(options.out / LOG_NAME, LOG_COLUMNS)

    def record(time_s: float, state: Array, reference: Array) -> None:
        if log is not None:
            log.write(np.concatenate(([time_s], state, reference))[None, :])

    companion = Companion(
        options.vehicle,
        options.stack,
        load_source(options.load, options.vehicle),
        options.path_from,
        options.duration_s,
        speaker.say,
        record,
    )
    speaker.say(f"{options.vehicle.name}: waiting for a flight stack on {options.over}")
    try:
        _loop(companion, link, truth, stop)
    finally:
        link.close()
        if truth is not None:
            truth.close()
        if log is not None:
            log.close()
    if stop:
        speaker.say(f"stopped by {stop.reason}: the stack's own failsafe takes over")
    return {
        "completed": companion.state is State.DONE,
        "failure": companion.failure,
        "stopped_by": stop.reason,
        "state": companion.state.name.lower(),
        "control_steps": companion.steps,
    }


def _loop(companion: Companion, link: Link, truth: Link | None, stop: StopRequest) -> None:
    while stop.reason is None and companion.state not in (State.DONE, State.FAILED):
        now = time.monotonic()
        if truth is not None:
            while (datagram := truth.receive(0.0)) is not None:
                companion.receive(datagram, time.monotonic())
        received = link.receive(min(companion.next_deadline(), now + 0.02))
        now = time.monotonic()
        if received is not None:
            companion.receive(received, now)
        for datagram in companion.to_send(now):
            link.send(datagram)
