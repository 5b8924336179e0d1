"""Real processes on real sockets, on free ports of 127.0.0.1, cleaned up by handle."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from sitl.flights.free_ports import free_ports
from tests.patience import PATIENCE


class Process:
    """A `sitl` command under test."""

    def __init__(self, *arguments: str, ignore_sigint: bool = False) -> None:
        def child_setup() -> None:
            if ignore_sigint:  # as a shell without job control starts things in the background
                signal.signal(signal.SIGINT, signal.SIG_IGN)

        self.popen = subprocess.Popen(
            [sys.executable, "-m", "sitl", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            preexec_fn=child_setup,
        )
        self._errors = b""
        self._deadline = 0.0
        assert self.popen.stderr is not None
        os.set_blocking(self.popen.stderr.fileno(), False)

    @property
    def errors(self) -> str:
        """What it has said on standard error so far."""
        assert self.popen.stderr is not None
        said = self.popen.stderr.read() or b""
        if said:
            self._be_patient()
        self._errors += said
        return self._errors.decode()

    def _be_patient(self) -> None:
        """Wait on: a flight on a busy machine may take long, but it says how it goes."""
        self._deadline = time.monotonic() + PATIENCE

    def wait_for(self, text: str) -> None:
        """Wait until it has said something."""
        self._be_patient()
        while text not in self.errors:
            assert self.popen.poll() is None, f"ended before it said {text!r}:\n{self.errors}"
            assert time.monotonic() < self._deadline, f"never said {text!r}:\n{self.errors}"
            assert self.popen.stderr is not None
            select.select([self.popen.stderr], [], [], 0.2)

    def finish(self) -> tuple[int, str, str]:
        """Wait for its end: exit code, standard output, standard error."""
        assert self.popen.stdout is not None
        output = b""
        self._be_patient()
        while True:
            readable, _, _ = select.select([self.popen.stdout], [], [], 0.2)
            if readable:
                data = os.read(self.popen.stdout.fileno(), 65536)
                if not data:
                    break
                output += data
                self._be_patient()
            _ = self.errors
            assert time.monotonic() < self._deadline, f"does not end:\n{self.errors}"
        code = self.popen.wait(PATIENCE)
        return code, output.decode(), self.errors

    def close(self) -> None:
        if self.popen.poll() is None:
            self.popen.kill()
        self.popen.wait()
        for stream in (self.popen.stdout, self.popen.stderr):
            if stream is not None:
                stream.close()


@pytest.fixture
def start() -> Iterator[Callable[..., Process]]:
    """Start `sitl ARGUMENTS…`; killed at the end of the test if it still runs."""
    processes: list[Process] = []

    def run(*arguments: str, **options: Any) -> Process:
        processes.append(Process(*arguments, **options))
        return processes[-1]

    yield run
    for process in processes:
        process.close()


@pytest.fixture
def port() -> int:
    """A free UDP port."""
    return free_ports(1)[0]


@pytest.fixture
def fly(start: Callable[..., Process], tmp_path: Path) -> Callable[..., dict[str, Any]]:
    """Fly a scenario to its end; its summary. `expect`: the exit code, None: as the summary has `settled`."""
    flights = iter(range(1000))

    def run(
        scenario: str, *arguments: str, clock: str = "lockstep", expect: int | None = 0
    ) -> dict[str, Any]:
        [free] = free_ports(1)
        out = tmp_path / f"flight{next(flights)}"
        code, output, errors = start(
            *("fly", scenario, "--clock", clock, "--json", "--out", str(out)),
            *("--hil", f"udpout:127.0.0.1:{free}"),
            *arguments,
        ).finish()
        assert code in (0, 1), errors
        assert output, errors
        summary: dict[str, Any] = json.loads(output)  # nothing else on standard output
        assert code == (expect if expect is not None else 0 if summary["settled"] else 1), errors
        assert summary == json.loads((out / "summary.json").read_text())
        return summary

    return run


def alive(pid: int) -> bool:
    """Whether a process still runs (a zombie does not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def children(pid: int) -> list[int]:
    """Processes that a process has started."""
    listing = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [int(text) for text in listing.split()]


def wait_until(condition: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.05)
