"""Plant and companion as child processes, and what they say while the stack flies."""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import IO, Any

from sitl.flights.launch import PATIENCE, POLL_INTERVAL, how_it_ended
from sitl_bridge.process import FLIGHT_OVER, StopRequest


@dataclass
class Account:
    """What both have said."""

    launched_at: float = field(default_factory=time.time)
    """UNIX time, s."""
    begin_usec: int | None = None
    """The plant's time when its log begins."""
    phases: dict[str, dict[str, Any]] = field(default_factory=dict)
    """The companion's phases by name, each with `plant_time_s` and `unix_time_s`."""
    plant_end: dict[str, Any] = field(default_factory=dict)
    companion_end: dict[str, Any] = field(default_factory=dict)
    failure: str | None = None
    """What went wrong, in one line."""

    def scenario_time(self, phase: str) -> float | None:
        """When a phase began, s of the plant's log; None: it did not, or there is no such log."""
        plant_time = self.phases.get(phase, {}).get("plant_time_s")
        if plant_time is None or self.begin_usec is None:
            return None
        return float(plant_time) - self.begin_usec * 1e-6


class Children:
    """The two processes; each ends when its standard input does."""

    def __init__(self, plant: Sequence[str], companion: Sequence[str], messages: int | None = None) -> None:
        """messages: file descriptor for what they say to people; None: standard error."""
        self._children: dict[str, subprocess.Popen[bytes]] = {}
        self._buffers = {"plant": b"", "companion": b""}
        for name, arguments in (("companion", companion), ("plant", plant)):
            child = subprocess.Popen(
                [sys.executable, "-m", "sitl", *arguments, "--until-eof"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=messages,
            )
            os.set_blocking(_pipe(child).fileno(), False)
            self._children[name] = child

    def watch(self, account: Account, stop: StopRequest, show: Callable[[dict[str, Any]], None]) -> None:
        """Until the companion's flight is over, a process ends before its time, or a request to stop.

        show: called with each progress event of the companion. Both processes are gone on return.
        """
        with selectors.DefaultSelector() as selector:
            for name, child in self._children.items():
                selector.register(_pipe(child), selectors.EVENT_READ, name)
            try:
                while not stop and not account.companion_end and account.failure is None:
                    for key, _ in selector.select(POLL_INTERVAL):
                        self._read(key.data, account, show)
                    self._notice_ends(account, show)
            finally:
                self._end(account, show)
        if stop:
            account.failure = f"stopped by {stop.reason}"
        elif account.companion_end.get("failure"):
            account.failure = account.companion_end["failure"]

    def _notice_ends(self, account: Account, show: Callable[[dict[str, Any]], None]) -> None:
        for name, child in self._children.items():
            if child.poll() is None:
                continue
            self._read(name, account, show)
            if not account.companion_end and account.failure is None:
                account.failure = f"the {name} {how_it_ended(child)}"

    def _end(self, account: Account, show: Callable[[dict[str, Any]], None]) -> None:
        """Ask both to end, wait, and kill what does not."""
        for child in self._children.values():
            assert child.stdin is not None
            with contextlib.suppress(OSError):  # gone already
                child.stdin.write(FLIGHT_OVER)
                child.stdin.close()
        deadline = time.monotonic() + PATIENCE
        for name, child in self._children.items():
            while child.poll() is None and time.monotonic() < deadline:
                self._read(name, account, show)
                time.sleep(POLL_INTERVAL / 5)
            if child.poll() is None:
                child.kill()
                child.wait()
            self._read(name, account, show)

    def _read(self, name: str, account: Account, show: Callable[[dict[str, Any]], None]) -> None:
        data = self._buffers[name]
        while chunk := _pipe(self._children[name]).read(65536):
            data += chunk
        *lines, self._buffers[name] = data.split(b"\n")
        for line in lines:
            _take(name, json.loads(line), account, show)


def _pipe(child: subprocess.Popen[bytes]) -> IO[bytes]:
    assert child.stdout is not None
    return child.stdout


def _take(name: str, event: dict[str, Any], account: Account, show: Callable[[dict[str, Any]], None]) -> None:
    kind = event.pop("event")
    if kind == "end":
        if name == "plant":
            account.plant_end = event
            if event.get("failure"):
                account.failure = f"the plant gave up: {event['failure']}"
        else:
            account.companion_end = event
    elif kind == "begin":
        account.begin_usec = event["time_usec"]
    elif kind == "phase":
        account.phases.setdefault(event.pop("phase"), event)
    elif kind == "progress" and name == "companion":
        show(event)
