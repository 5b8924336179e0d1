"""`sitl fly`: launches plant and controller as two processes, watches them, and reports on the flight."""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import IO, Any

from sitl.flights.child import Child, Forked, can_fork, launched
from sitl_bridge.process import FLIGHT_OVER, StopRequest

PATIENCE = 60.0
"""How long a process may take to stop before it is killed, s."""
POLL_INTERVAL = 0.1


class FlightError(RuntimeError):
    """A flight did not take place as asked for."""


@dataclass
class Outcome:
    """How a pair of processes ended."""

    end: dict[str, Any] = field(default_factory=dict)
    """The plant's own account."""
    failure: str | None = None
    """What went wrong, in one line."""
    first_command_unix_s: float | None = None
    launch_to_first_command_s: float | None = None
    law: dict[str, Any] | None = None
    """Name and cost of the user's own law, see `OwnLawPilot.cost`."""
    legs_began_s: list[float] = field(default_factory=list)
    """When each leg of the reference began, s since the law took over; see `pilot.legs`."""
    mode: str | None = None
    """The last one that the controller told of, under ground control."""


class Pair:
    """Plant and controller as child processes, which end when this process does."""

    def __init__(
        self,
        plant: Sequence[str],
        controller: Sequence[str],
        messages: int | None = None,
        forked: bool = False,
    ) -> None:
        """messages: file descriptor for what they say to people; None: standard error.

        forked: as copies of this process, if they can be: for a process that has little beside the product.
        """
        self.launched_at = time.time()
        self.processes: dict[str, Child] = {}
        make = Forked if forked and can_fork() else launched
        # The controller takes longer to start: it goes first. Each ends when its standard input does,
        # so that nothing is left running even if this process is killed.
        for name, arguments in (("controller", controller), ("plant", plant)):
            self.processes[name] = make([name, *arguments, "--until-eof"], messages)

    def ended(self) -> str | None:
        """The name of a process that has ended, if one has."""
        return next((name for name, child in self.processes.items() if child.poll() is not None), None)

    def finish(self) -> None:
        """The flight is over: let them end by themselves, for a while."""
        for child in self.processes.values():
            assert child.stdin is not None
            with contextlib.suppress(OSError):  # gone already
                child.stdin.write(FLIGHT_OVER)
                child.stdin.flush()
        deadline = time.monotonic() + PATIENCE
        with contextlib.suppress(subprocess.TimeoutExpired):
            for child in self.processes.values():
                child.wait(max(0.0, deadline - time.monotonic()))

    def stop(self) -> None:
        """Ask both to stop, wait, and kill what does not."""
        for child in self.processes.values():
            if child.poll() is None:
                child.terminate()
        deadline = time.monotonic() + PATIENCE
        for child in self.processes.values():
            try:
                child.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()


def how_it_ended(child: Child) -> str:
    """The way a process ended, in words."""
    code = child.returncode
    if code is not None and code < 0:
        return f"was killed by {signal.Signals(-code).name}"
    return f"ended with exit code {code}"


def watch(pair: Pair, stop: StopRequest, show: Callable[[dict[str, Any]], None]) -> Outcome:
    """Wait for the flight's end, for a process to end before its time, or for a request to stop.

    show(event): called with each progress event of the plant, which has the controller's `mode` and
    `legs_began_s`, too. Both processes are gone on return.
    """
    outcome = Outcome()
    events = {name: _Events(child) for name, child in pair.processes.items()}

    def take() -> None:
        for name in ("controller", "plant"):
            for event in events[name].read():
                _take(name, event, outcome, pair, show)

    with selectors.DefaultSelector() as selector:
        for name in events:
            selector.register(events[name].stream, selectors.EVENT_READ)
        try:
            while not stop and not outcome.end:
                if selector.select(POLL_INTERVAL):
                    take()
                name = pair.ended() or ""
                if name and not outcome.end:
                    take()
                    if outcome.end:
                        break
                    others = "plant" if name == "controller" else "controller"
                    ending = how_it_ended(pair.processes[name])
                    outcome.failure = outcome.failure or f"the {name} {ending}; the {others} was stopped"
                    break
            if outcome.end and not stop:
                pair.finish()
        finally:
            pair.stop()
            take()
    if stop:
        outcome.failure = f"stopped by {stop.reason}"
    return outcome


class _Events:
    """The events on a process' standard output."""

    def __init__(self, child: Child) -> None:
        assert child.stdout is not None
        self.stream: IO[bytes] = child.stdout
        self._rest = b""
        os.set_blocking(self.stream.fileno(), False)

    def read(self) -> list[dict[str, Any]]:
        """Those that are complete by now."""
        while data := self.stream.read(65536):
            self._rest += data
        *lines, self._rest = self._rest.split(b"\n")
        return [json.loads(line) for line in lines]


def _take(
    name: str,
    event: dict[str, Any],
    outcome: Outcome,
    pair: Pair,
    show: Callable[[dict[str, Any]], None],
) -> None:
    kind = event.pop("event")
    if kind == "mode":
        outcome.mode = event["mode"]
    elif kind == "begin":
        outcome.first_command_unix_s = event["unix_time_s"]
        outcome.launch_to_first_command_s = event["unix_time_s"] - pair.launched_at
    elif kind == "progress":
        show({**event, "mode": outcome.mode, "legs_began_s": outcome.legs_began_s})
    elif kind == "leg":
        outcome.legs_began_s[event["number"] - 1 :] = [event["began_s"]]
    elif kind == "end" and name == "controller":
        outcome.law = event.get("law")
        outcome.legs_began_s = event.get("legs_began_s", [])
        outcome.failure = event.get("failure") or outcome.failure
    elif kind == "end" and name == "plant":
        if failure := event.pop("failure"):
            outcome.failure = f"the plant gave up: {failure}"
        outcome.end = event
