"""The companion's process: the stack's link, the plant's truth where there is one, and one loop."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from controller.feedback.truth import PathFrom
from controller.law.state import LOAD_POSITION
from controller.over.ages import Ages
from controller.over.baseline import Baseline
from controller.over.companion import Companion
from controller.over.flight import Flight
from controller.over.identify.probe import Probe
from controller.over.live.link import LoadLink
from controller.over.live.load_system import LoadSystem
from controller.over.live.reference import LiveReference
from controller.over.load.filtered import load_source
from controller.over.load.source import TruthSource
from controller.over.model import Steering
from controller.over.stack import Stack
from controller.over.states import State, Step
from sitl_bridge.event_log import EventLog
from sitl_bridge.mavlink.framing import split
from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.mavlink.links.link import Link
from sitl_bridge.mavlink.links.opening import open_link
from sitl_bridge.process import Speaker, StopRequest
from sitl_bridge.rowlog import RowLog
from sitl_bridge.vehicle.cable_law import linearised
from sitl_bridge.vehicle.description import Vehicle

LONGEST_TURN = 0.02
"""s between two looks at the links."""
MOST_DATAGRAMS = 100
"""Of the stack in a turn, so that a flood does not keep set-points back."""
REPORT_INTERVAL = 0.2
"""s between two progress events."""
LOG_NAME = "companion.parquet"
LOG_COLUMNS = (
    "time_s",
    *(f"{body}_{axis}_m" for body in ("vehicle", "load") for axis in "xyz"),
    *(f"{body}_v{axis}_m_s" for body in ("vehicle", "load") for axis in "xyz"),
    *(f"body_rate_{axis}_rad_s" for axis in "pqr"),
    *(f"{angle}_rad" for angle in ("roll", "pitch", "yaw")),
    *(f"reference_{axis}_m" for axis in "xyz"),
)


class LivePorts(NamedTuple):
    """UDP ports of the load's own MAVLink system."""

    local: int
    peer: int
    """Whom it speaks to first."""


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
    """Where the load is known from: truth, tracker, position or none."""
    load_link: Address | None = None
    """Link on which a load sensor's messages come, besides the stack's own."""
    truth: Address | None = None
    """Link on which the plant's truth comes: to fly on with load = truth, else for the record."""
    out: Path | None = None
    wait_s: float = math.inf
    """How long to wait for the stack."""
    probe: Probe | None = None
    """Measures how the stack follows, while the reference is flown."""
    baseline: Baseline | None = None
    """Let the stack's own position control fly instead of the law."""
    live: LivePorts | None = None
    """Take points live on these ports, instead of path_from's reference."""
    instance: int = 0
    steering: Steering = Steering.RATES
    """What the stack is given besides the thrust."""


class Report:
    """Events for a parent: phases with the plant's time, and progress."""

    def __init__(self, flight: Flight, plant: TruthSource | None, speaker: Speaker) -> None:
        self._flight, self._plant, self._speaker = flight, plant, speaker
        self._due = 0.0
        self._state: State | None = None

    def tell(self, now: float) -> None:
        """Say what is new, or due."""
        flight = self._flight
        changed = flight.state is not self._state
        if changed:
            self._state = flight.state
            self._speaker.note("mode", flight.state.value)
            plant_time = None if self._plant is None else self._plant.time_s
            self._speaker.event(
                "phase", phase=flight.state.name.lower(), plant_time_s=plant_time, unix_time_s=time.time()
            )
        if now < self._due and not changed:
            return
        self._due = now + REPORT_INTERVAL
        step = flight.last_step
        self._speaker.event(
            "progress",
            doing=flight.state.value,
            time_s=None if step is None else step.time_s,
            load_m=None if step is None else step.state[LOAD_POSITION].tolist(),
            reference_m=None if step is None else step.reference.tolist(),
        )


class Live:
    """The load's own system on its link."""

    def __init__(self, options: OverOptions, ports: LivePorts, speaker: Speaker) -> None:
        self.reference = LiveReference(options.vehicle)
        self._system = LoadSystem(options.instance, self.reference, speaker.say)
        self._link = LoadLink(*ports)
        speaker.say(
            f"the load is system {self._system.system}: this end 127.0.0.1:{ports.local}, listen on "
            f"udp:127.0.0.1:{ports.peer}"
        )

    def turn(self, flight: Flight, now: float) -> None:
        """Take in what clients ask for, show them where the load is."""
        step, system = flight.last_step, self._system
        if step is not None:
            system.show(step.state, flight.stack_time)
        if system.origin is None:
            system.origin = flight.state_origin()
        system.home_altitude = flight.telemetry.home_altitude
        for datagram in self._link.receive(now):
            system.receive(datagram)
        self._link.send(system.to_send(now), now)

    def close(self) -> None:
        """Free the port."""
        self._link.close()


class Log:
    """A row for each step of the law."""

    def __init__(self, out: Path) -> None:
        out.mkdir(parents=True, exist_ok=True)
        self._log = RowLog(out / LOG_NAME, LOG_COLUMNS)
        self._last: Step | None = None

    def write(self, step: Step | None) -> None:
        """Keep a step, once."""
        if step is not None and step is not self._last:
            self._last = step
            self._log.write(np.concatenate(([step.time_s], step.state, step.reference))[None, :])

    def close(self) -> None:
        """Finish the file."""
        self._log.close()


def run(options: OverOptions, speaker: Speaker, stop: StopRequest) -> dict[str, Any]:
    """Fly once over a stack; returns what to report of it. Raises OSError when a link cannot be opened."""
    options = replace(options, vehicle=linearised(options.vehicle))
    link = open_link(options.over, speaker.say, punctual=True)
    truth = None if options.truth is None else open_link(options.truth, speaker.say)
    sensor = None if options.load_link is None else open_link(options.load_link, speaker.say)
    log = None if options.out is None else Log(options.out)
    source = load_source(options.load, options.vehicle)
    plant = source if isinstance(source, TruthSource) else None if truth is None else TruthSource()
    live = None if options.live is None else Live(options, options.live, speaker)
    flight = Flight(
        options.vehicle,
        options.stack,
        source,
        options.path_from,
        options.duration_s,
        speaker.say,
        options.probe,
        options.baseline,
        Ages(lambda: None if plant is None else plant.time_s),
        None if live is None else live.reference,
        options.steering,
    )
    companion = Companion(flight, options.wait_s)
    report = Report(flight, plant, speaker)
    if options.out is not None:
        speaker.keep(EventLog(options.out), lambda: flight.last_step and flight.last_step.time_s)
    speaker.say(f"{options.vehicle.name}: waiting for a flight stack on {options.over}")
    try:
        while stop.reason is None and not companion.over:
            _turn(companion, link, sensor, truth, plant)
            if log is not None:
                log.write(flight.last_step)
            if live is not None:
                live.turn(flight, time.monotonic())
            report.tell(time.monotonic())
    finally:
        link.close()
        if live is not None:
            live.close()
        for other in (truth, sensor):
            if other is not None:
                other.close()
        if log is not None:
            log.close()
    if stop:
        speaker.say(f"stopped by {stop.reason}: nothing more is sent; the stack's own failsafe holds")
    outcome = {
        "completed": flight.state is State.DONE,
        "failure": flight.failure,
        "stopped_by": stop.reason,
        "state": flight.state.name.lower(),
        "control_steps": flight.steps,
    }
    speaker.event("end", **outcome)
    return outcome


def _turn(
    companion: Companion, link: Link, sensor: Link | None, truth: Link | None, plant: TruthSource | None
) -> None:
    """What the links bring until something is due, and what is due."""
    received = [link.receive(min(companion.next_deadline(), time.monotonic() + LONGEST_TURN))]
    while received[-1] is not None and len(received) < MOST_DATAGRAMS:
        received.append(link.receive(0.0))
    now = time.monotonic()
    if truth is not None:  # first: a set-point is made when the stack's state is taken in
        while (datagram := truth.receive(0.0)) is not None:
            companion.receive(datagram, now)
            if plant is not None and plant is not companion.flight.source:
                for frame in split(datagram).frames:
                    plant.hear(frame, now)
    if sensor is not None:
        while (datagram := sensor.receive(0.0)) is not None:
            companion.receive(datagram, now)
    for datagram in received:
        if datagram is not None:
            companion.receive(datagram, now)
    for datagram in companion.to_send(now):
        link.send(datagram)
