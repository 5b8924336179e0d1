"""Plant and controller joined in one process: the same protocol objects and MAVLink bytes, without sockets.

Lockstep in virtual time. A flight has the same state log, to the byte, as two processes in lockstep with its
seed. There is no global state: flights may run side by side.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.feedback.truth import PathFrom
from controller.own_law.find import ChosenLaw
from controller.own_law.interface import LawError
from controller.run import ControllerOptions, Session, open_session
from sitl_bridge.event_log import EventLog
from sitl_bridge.log_amount import Logs
from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.mavlink.tlog import FILE_NAME as TLOG_NAME
from sitl_bridge.mavlink.tlog import RECORDED_HZ, TlogWriter
from sitl_bridge.plant.clocks.lockstep import Lockstep
from sitl_bridge.plant.faults.schedule import Faults
from sitl_bridge.plant.log.notices import Notices
from sitl_bridge.plant.log.state_log import FILE_NAME, RowTable, StateLog
from sitl_bridge.plant.physics.world import World
from sitl_bridge.plant.run import progress_of
from sitl_bridge.plant.sensing import Diverged
from sitl_bridge.plant.simulation import NO_FAULTS, Simulation
from sitl_bridge.process import Speaker, StopRequest
from sitl_bridge.vehicle.description import Vehicle

NOWHERE = Address("udpout", "127.0.0.1", 0)
"""There is no link."""
PROGRESS_EVERY = 250
"""Ticks between two looks at the wall clock and the stop request."""
MOST_FREEWHEELING = 10_000
"""Ticks without an answer, after which something is wrong."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class InProcessFlight:
    """One flight. `told`: the description that the controller has; `flown`: the one that is simulated."""

    told: Vehicle
    flown: Vehicle
    path_from: PathFrom
    duration_s: float
    rate_hz: float = 250.0
    seed: int = 0
    design: str = "default"
    feedback: str = "truth"
    instance: int = 0
    faults: Faults = NO_FAULTS
    law: ChosenLaw | None = None
    """A law of the user's own, instead of the design."""
    out: Path | None = None
    """Where logs go; None: they are kept in memory."""
    logs: Logs = "usual"
    """How much goes there."""


@dataclass
class Ended:
    """How it ended."""

    account: dict[str, Any]
    """As a plant reports it: `plant.log.account.Account`."""
    states: Array | None = None
    """(n, columns) of the state log, where it was kept in memory."""
    names: list[str] = field(default_factory=list)
    """Of the columns."""
    began_at: float | None = None
    """Unix time, s, of the first armed answer; None: it never came."""
    said: list[str] = field(default_factory=list)
    """What plant and controller had to say."""
    law: dict[str, Any] | None = None
    """Name and cost of the user's own law, see `OwnLawPilot.cost`."""
    legs_began_s: list[float] = field(default_factory=list)
    """When each leg of the reference began, s; see `pilot.legs`."""
    law_failure: LawError | None = None
    """Why it could not go on."""


class MemoryLog(RowTable):
    """The state log's rows in memory."""

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._chunks: list[Array] = []

    def keep(self, rows: Array) -> None:
        """Keep a chunk."""
        self._chunks.append(rows)

    def rows(self) -> Array:
        """(n, columns): all of them."""
        self.flush()
        return np.concatenate(self._chunks) if self._chunks else np.zeros((0, len(self.names)))


def fly_in_process(
    flight: InProcessFlight,
    stop: StopRequest | None = None,
    show: Callable[[dict[str, Any]], None] = lambda event: None,
    say: Callable[[str], None] | None = None,
) -> Ended:
    """Fly; returns how it ended. Raises OSError when a log cannot be written.

    show: called now and then with a progress event, as `sitl fly` gets them. say: takes each line for a
    person; by default they are only kept.
    """
    said: list[str] = []
    take = said.append if say is None else say
    plant, controller = _Collector("plant", take), _Collector("controller", take)
    began: list[float] = []
    simulation = Simulation(
        flight.flown,
        flight.rate_hz,
        flight.seed,
        flight.instance,
        flight.duration_s,
        on_begin=lambda: began.extend((time.monotonic(), time.time())),
        faults=flight.faults,
        end_when_lost=True,
        on_fault=lambda text: plant.note("fault", text),
    )
    recorder: StateLog | MemoryLog
    tlog = None
    if flight.out is None:
        recorder = MemoryLog(simulation.world)
    else:
        flight.out.mkdir(parents=True, exist_ok=True)
        recorder = StateLog(flight.out / FILE_NAME, simulation.world)
        tlog = TlogWriter(flight.out / TLOG_NAME, RECORDED_HZ[flight.logs])
    simulation.record_with(recorder)
    session = open_session(_controller_options(flight), controller)
    clock = Lockstep(simulation, Notices(plant.say), flight.instance)
    if flight.out is not None:
        diary = EventLog(flight.out)
        plant.keep(diary, lambda: simulation.scenario_time if simulation.started else None)
        controller.keep(diary, lambda: session.hil.scenario_time)
    failure = None
    try:
        _loop(clock, session, tlog, stop, lambda: show(_progress(simulation, began, session)))
    except Diverged as error:
        failure = str(error)
    finally:
        session.close_logs()
        if tlog is not None:
            tlog.close()
        if isinstance(recorder, StateLog):
            recorder.close()
    ended = Ended(_account(flight, simulation, began, stop, failure), said=said)
    ended.began_at = began[1] if began else None
    ended.legs_began_s = _legs_began(session)
    if session.own_law is not None:
        ended.law, ended.law_failure = session.own_law.cost, session.own_law.failure
    if isinstance(recorder, MemoryLog):
        ended.states, ended.names = recorder.rows(), recorder.names
    return ended


def _loop(
    clock: Lockstep,
    opened: Session,
    tlog: TlogWriter | None,
    stop: StopRequest | None,
    report: Callable[[], None],
) -> None:
    """Datagrams go straight from one object to the other; virtual time is the plant's."""
    simulation, session, own_law = clock.simulation, opened.hil, opened.own_law
    now, waited, left = 0.0, 0, PROGRESS_EVERY
    epoch = time.time()
    clock.start(now)
    while not simulation.finished:
        for tick in clock.to_send(now):
            if tlog is not None:
                tlog.write(tick, epoch + now)
            session.receive(tick, now)
        for answer in session.to_send(now):
            if tlog is not None:
                tlog.write(answer, epoch + now)
            clock.receive(answer, now)
        if own_law is not None and own_law.failure is not None:
            return
        now = max(now + 1e-6, clock.next_deadline())
        left -= 1
        if left == 0:
            left = PROGRESS_EVERY
            if stop is not None and stop.reason is not None:
                return
            report()
            waited = 0 if simulation.started else waited + PROGRESS_EVERY
            if waited > MOST_FREEWHEELING:
                raise RuntimeError(
                    "the controller never armed: its feedback never became good enough to start"
                )


class _Collector(Speaker):
    """Takes the lines that plant and controller say."""

    def __init__(self, name: str, take: Callable[[str], None]) -> None:
        super().__init__(name, events=False)
        self._take = take

    def _show(self, text: str) -> None:
        self._take(text)


def _controller_options(flight: InProcessFlight) -> ControllerOptions:
    return ControllerOptions(
        vehicle=flight.told,
        hil=NOWHERE,
        design=flight.design,
        rate_hz=flight.rate_hz,
        path_from=flight.path_from,
        instance=flight.instance,
        seed=flight.seed,
        feedback=flight.feedback,
        out=flight.out,
        logs=flight.logs,
        law=flight.law,
    )


def _progress(simulation: Simulation, began: list[float], session: Session) -> dict[str, Any]:
    more = {"real_time_factor": _factor(simulation, began), "legs_began_s": _legs_began(session)}
    return {**progress_of(simulation), **more}


def _legs_began(session: Session) -> list[float]:
    return [] if session.legs is None else session.legs.began_s


def _factor(simulation: Simulation, began: list[float]) -> float | None:
    """Simulated seconds a second since the scenario began."""
    if not began:
        return None
    return simulation.scenario_time / max(1e-9, time.monotonic() - began[0])


def _account(
    flight: InProcessFlight,
    simulation: Simulation,
    began: list[float],
    stop: StopRequest | None,
    failure: str | None,
) -> dict[str, Any]:
    """As `plant.run` reports it."""
    return {
        "completed": simulation.finished,
        "failure": failure,
        "stopped_by": None if stop is None else stop.reason,
        "time_s": simulation.scenario_time,
        "real_time_factor": _factor(simulation, began),
        "lateness_us": {"p50": None, "p99": None, "max": None},
        "late_ticks": 0,
        "resent_ticks": 0,
        "unanswered_ticks": 0,
        "state_log": None if flight.out is None else str(flight.out / FILE_NAME),
        "tlog": None if flight.out is None else str(flight.out / TLOG_NAME),
    }
