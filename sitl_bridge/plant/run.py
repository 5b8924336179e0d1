"""The plant's process: a link, a clock, and one loop that waits for the next datagram or deadline."""

from __future__ import annotations

import gc
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from sitl_bridge.event_log import EventLog
from sitl_bridge.log_amount import Logs
from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.mavlink.links.link import Link
from sitl_bridge.mavlink.links.lossy import LossyLink
from sitl_bridge.mavlink.links.opening import open_link
from sitl_bridge.mavlink.tlog import FILE_NAME as TLOG_NAME
from sitl_bridge.mavlink.tlog import RECORDED_HZ, TlogWriter
from sitl_bridge.plant.clocks.lateness import Lateness
from sitl_bridge.plant.clocks.lockstep import Lockstep, OnSilence
from sitl_bridge.plant.clocks.realtime import Realtime
from sitl_bridge.plant.faults.impaired_link import FaultyLink
from sitl_bridge.plant.faults.schedule import Faults
from sitl_bridge.plant.log.account import Account
from sitl_bridge.plant.log.notices import Notices
from sitl_bridge.plant.log.state_log import FILE_NAME, StateLog
from sitl_bridge.plant.lost_vehicle import condition
from sitl_bridge.plant.physics.state import LOAD_POSITION
from sitl_bridge.plant.sensing import Diverged
from sitl_bridge.plant.simulation import NO_FAULTS, Simulation
from sitl_bridge.plant.wire.load_to import LoadTo
from sitl_bridge.plant.wire.speed import SpeedService
from sitl_bridge.plant.wire.truth_to import TruthTo
from sitl_bridge.process import Speaker, StopRequest
from sitl_bridge.vehicle.description import Vehicle

MOST_HEARD = 10
"""Datagrams of a viewer that are taken in before the flight goes on."""
REPORT_INTERVAL = 0.2
"""Between two progress events, s."""


@dataclass(frozen=True)
class PlantOptions:
    """What a plant is started with."""

    vehicle: Vehicle
    hil: Address
    clock: Literal["realtime", "lockstep"]
    rate_hz: float
    seed: int
    instance: int
    speed: float | None = None
    duration_s: float | None = None
    drop_percent: float = 0.0
    on_silence: OnSilence = "wait"
    out: Path | None = None
    """Where logs go."""
    logs: Logs = "usual"
    """How much goes there."""
    faults: Faults = NO_FAULTS
    load_to: tuple[str, int] | None = None
    """Ground station that is shown the load directly."""
    end_when_lost: bool = False
    """End the scenario a few seconds after the vehicle is lost."""
    truth_to: Sequence[tuple[str, int]] = ()
    """Viewers and companions that are shown the true state of vehicle and load."""


def progress_of(simulation: Simulation) -> dict[str, Any]:
    """How a scenario goes: fields of a progress event."""
    world = simulation.world
    return {
        "time_s": simulation.scenario_time,
        "load_m": world.state[LOAD_POSITION].tolist(),
        "tension_N": world.cable_tension(),
        "condition": condition(world.vehicle, world.state, world.cable_holds),
    }


class Progress:
    """When the scenario began and how it goes, in wall time."""

    def __init__(self, speaker: Speaker) -> None:
        self._speaker = speaker
        self.due = 0.0
        """When there is something to report, of `time.monotonic()`."""
        self.began_at: float | None = None

    def begin(self, time_usec: int) -> None:
        """The first armed answer is in; time_usec: of the tick with which the scenario begins."""
        self.began_at = time.monotonic()
        self._speaker.say("the autopilot is armed: the scenario begins")
        self._speaker.event("begin", unix_time_s=time.time(), time_usec=time_usec)

    def report(self, now: float, simulation: Simulation) -> None:
        """Say how far the scenario is, from time to time."""
        self.due = now + REPORT_INTERVAL
        if self.began_at is None:
            return
        self._speaker.event("progress", **progress_of(simulation), real_time_factor=self.factor(simulation))

    def factor(self, simulation: Simulation) -> float | None:
        """Simulated seconds a second, since the scenario began."""
        if self.began_at is None:
            return None
        return simulation.scenario_time / max(1e-9, time.monotonic() - self.began_at)


def run(options: PlantOptions, speaker: Speaker, stop: StopRequest) -> Account:
    """Run a plant until its scenario is over or it is asked to stop; returns what to report of it.

    Raises OSError when the link cannot be opened or a log not written.
    """
    progress = Progress(speaker)
    simulation = Simulation(
        options.vehicle,
        options.rate_hz,
        options.seed,
        options.instance,
        options.duration_s,
        on_begin=lambda: progress.begin(simulation.time_usec),
        faults=options.faults,
        end_when_lost=options.end_when_lost,
        on_fault=lambda text: speaker.note("fault", text),
    )
    punctual = options.clock == "realtime" or bool(options.faults.link)
    link = open_link(options.hil, speaker.say, punctual)
    log, tlog = None, None
    if options.out is not None:  # behind the link: a port in use leaves no empty logs
        speaker.keep(EventLog(options.out), lambda: simulation.scenario_time if simulation.started else None)
        log = StateLog(options.out / FILE_NAME, simulation.world)
        simulation.record_with(log)
        tlog = TlogWriter(options.out / TLOG_NAME, RECORDED_HZ[options.logs])
    if options.drop_percent:
        link = LossyLink(link, options.drop_percent, options.seed)
    if options.faults.link:
        link = FaultyLink(link, options.faults.link, options.seed, lambda: progress.began_at)
    notices = Notices(speaker.say)
    clock: Lockstep | Realtime
    if options.clock == "lockstep":
        clock = Lockstep(
            simulation, notices, options.instance, options.speed, not link.reliable, options.on_silence
        )
    else:
        clock = Realtime(simulation, notices, options.instance)
    speaker.say(
        f"{options.vehicle.name}, {options.clock} at {options.rate_hz:g} Hz, "
        f"waiting for an autopilot on {options.hil} (system {options.instance + 1})"
    )
    audience: list[Listener] = []
    failure = None
    try:
        if options.load_to is not None:
            audience.append(Listener(options.load_to, LoadTo(options.instance, simulation.origin)))
        speed = SpeedService(options.instance, clock, speaker.say)
        for address in options.truth_to:
            audience.append(Listener(address, TruthTo(options.instance, simulation.origin), speed))
        _loop(clock, link, tlog, progress, audience, stop)
    except Diverged as error:
        failure = str(error)
        speaker.say(f"{failure}: it ends here; what the description asks for cannot be simulated")
    finally:
        factor = progress.factor(simulation)  # now: the logs take their time to close
        link.close()
        for listener in audience:
            listener.close()
        if tlog is not None:
            tlog.close()
        if log is not None:
            log.close()
    if stop:
        speaker.say(f"stopped by {stop.reason} at t = {simulation.scenario_time:.2f} s")
    outcome = _outcome(options, clock, factor, stop, failure)
    speaker.event("end", **outcome)
    return outcome


class Listener:
    """A ground station or a viewer that is told of the flight, at the pace of the wall clock.

    speed: what answers it; None: nothing that it says is listened to.
    """

    def __init__(
        self, address: tuple[str, int], source: LoadTo | TruthTo, speed: SpeedService | None = None
    ) -> None:
        self._link = open_link(Address("udpout", *address), lambda text: None)
        self._source = source
        self._speed = speed

    def show(self, now: float, simulation: Simulation) -> None:
        """Send what is due, and then take in what the listener says."""
        datagram = self._source.to_send(now, simulation)
        if datagram is None:
            return
        self._link.send(datagram)
        if self._speed is None:
            return
        for _ in range(MOST_HEARD):
            said = self._link.receive(now)
            if said is None:
                return
            if reply := self._speed.receive(said, now):
                self._link.send(reply)

    def close(self) -> None:
        """Free the port."""
        self._link.close()


def _loop(
    clock: Lockstep | Realtime,
    link: Link,
    tlog: TlogWriter | None,
    progress: Progress,
    audience: list[Listener],
    stop: StopRequest,
) -> None:
    gc.freeze()  # what was built at start-up stays; collections in flight have little to look at
    epoch = time.time() - time.monotonic()
    simulation = clock.simulation
    now = time.monotonic()
    clock.start(now)
    while not simulation.finished and stop.reason is None:
        for datagram in clock.to_send(now):
            link.send(datagram)
            if tlog is not None:
                tlog.write(datagram, epoch + now)
        received = link.receive(clock.next_deadline())
        now = time.monotonic()
        if received is not None:
            clock.receive(received, now)
            if tlog is not None:
                tlog.write(received, epoch + now)
        if now >= progress.due:
            progress.report(now, simulation)
        for listener in audience:
            listener.show(now, simulation)


def _outcome(
    options: PlantOptions,
    clock: Lockstep | Realtime,
    factor: float | None,
    stop: StopRequest,
    failure: str | None,
) -> Account:
    lateness = clock.lateness if isinstance(clock, Realtime) else Lateness()
    late_s = {"p50": lateness.percentile(50), "p99": lateness.percentile(99)}
    late_s["max"] = lateness.largest if lateness.ticks else None
    return {
        "completed": clock.finished,
        "failure": failure,
        "stopped_by": stop.reason,
        "time_s": clock.simulation.scenario_time,
        "real_time_factor": factor,
        "lateness_us": {key: None if late is None else late * 1e6 for key, late in late_s.items()},
        "late_ticks": clock.late_ticks if isinstance(clock, Realtime) else 0,
        "resent_ticks": clock.resent_ticks if isinstance(clock, Lockstep) else 0,
        "unanswered_ticks": clock.unanswered_ticks if isinstance(clock, Lockstep) else 0,
        "state_log": None if options.out is None else str(options.out / FILE_NAME),
        "tlog": None if options.out is None else str(options.out / TLOG_NAME),
    }
