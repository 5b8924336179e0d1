"""`sitl fly`: launches plant and controller as two processes, watches them, and reports on the flight."""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import IO, Any

from sitl_bridge.process import FLIGHT_OVER, StopRequest

PATIENCE = 10.0
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


class ProgressLine:
    """A line that is rewritten on a terminal, and repeated now and then in a file."""

    FILE_INTERVAL = 5.0

    def __init__(self, stream: IO[str]) -> None:
        self._stream = stream
        self._rewrites = stream.isatty()
        self._next = 0.0
        self._open = False

    def show(self, text: str) -> None:
        """Show the line as it is now."""
        if self._rewrites:
            self._stream.write(f"\r\x1b[K{text}")
            self._open = True
        elif time.monotonic() >= self._next:
            self._next = time.monotonic() + self.FILE_INTERVAL
            self._stream.write(f"{text}\n")
        self._stream.flush()

    def end(self) -> None:
        """Leave the line as it stands."""
        if self._open:
            self._stream.write("\n")
            self._stream.flush()
        self._open = False


class Pair:
    """Plant and controller as child processes, which end when this process does."""

    def __init__(self, plant: Sequence[str], controller: Sequence[str]) -> None:
        self.launched_at = time.time()
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        # The controller takes longer to start: it goes first. Each ends when its standard input does,
        # so that nothing is left running even if this process is killed.
        for name, arguments in (("controller", controller), ("plant", plant)):
            self.processes[name] = subprocess.Popen(
                [sys.executable, "-m", "sitl", name, *arguments, "--until-eof"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE if name == "plant" else subprocess.DEVNULL,
            )

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


def how_it_ended(child: subprocess.Popen[bytes]) -> str:
    """The way a process ended, in words."""
    code = child.returncode
    if code is not None and code < 0:
        return f"was killed by {signal.Signals(-code).name}"
    return f"ended with exit code {code}"


def watch(pair: Pair, stop: StopRequest, show: Any) -> Outcome:
    """Wait for the flight's end, for a process to end before its time, or for a request to stop.

    show(event): called with each progress event of the plant. Both processes are gone on return.
    """
    outcome = Outcome()
    plant = pair.processes["plant"]
    assert plant.stdout is not None
    os.set_blocking(plant.stdout.fileno(), False)
    buffer = b""
    with selectors.DefaultSelector() as selector:
        selector.register(plant.stdout, selectors.EVENT_READ)
        try:
            while not stop and not outcome.end:
                if selector.select(POLL_INTERVAL):
                    buffer = _events(plant.stdout, buffer, outcome, pair, show)
                name = pair.ended()
                if name is not None and not outcome.end:
                    buffer = _events(plant.stdout, buffer, outcome, pair, show)
                    if outcome.end:
                        break
                    others = "plant" if name == "controller" else "controller"
                    ending = how_it_ended(pair.processes[name])
                    outcome.failure = f"the {name} {ending}; the {others} was stopped"
                    break
            if outcome.end and not stop:
                pair.finish()
        finally:
            pair.stop()
            _events(plant.stdout, buffer, outcome, pair, show)
    if stop:
        outcome.failure = f"stopped by {stop.reason}"
    return outcome


def _events(stream: IO[bytes], buffer: bytes, outcome: Outcome, pair: Pair, show: Any) -> bytes:
    """Take in the plant's events; returns the beginning of one that is not complete."""
    while data := stream.read(65536):
        buffer += data
    *lines, rest = buffer.split(b"\n")
    for line in lines:
        event = json.loads(line)
        kind = event.pop("event")
        if kind == "begin":
            outcome.first_command_unix_s = event["unix_time_s"]
            outcome.launch_to_first_command_s = event["unix_time_s"] - pair.launched_at
        elif kind == "progress":
            show(event)
        elif kind == "end":
            if failure := event.pop("failure"):
                outcome.failure = f"the plant gave up: {failure}"
            outcome.end = event
    return rest
