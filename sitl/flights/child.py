"""Commands of `sitl` as child processes, which end when their standard input does.

A forked one has what this process has imported: it starts in milliseconds, where a new interpreter takes some
tenths of a second, and shares the memory.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, NoReturn, Protocol

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_LONGEST_WAIT = 0.02
"""s between two looks whether a process has ended."""


class Child(Protocol):
    """What is needed of a `subprocess.Popen`."""

    pid: int
    returncode: int | Any | None

    @property
    def stdin(self) -> IO[bytes] | None: ...
    @property
    def stdout(self) -> IO[bytes] | None: ...
    def poll(self) -> int | None: ...
    def wait(self, timeout: float | None = None) -> int: ...
    def terminate(self) -> None: ...
    def kill(self) -> None: ...


def launched(command: Sequence[str], messages: int | None) -> Child:
    """A command of `sitl` in an interpreter of its own.

    messages: file descriptor for its standard error; None: it has ours.
    """
    return subprocess.Popen(
        [sys.executable, "-m", "sitl", *command],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=messages,
    )


def can_fork() -> bool:
    """Whether a forked child would be sound: no other thread may hold a lock that it needs.

    On macOS system libraries do not bear it.
    """
    return sys.platform == "linux" and threading.active_count() == 1


class Forked:
    """A command of `sitl` in a copy of this process; as `launched` otherwise."""

    def __init__(self, command: Sequence[str], messages: int | None) -> None:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError, AttributeError):
                stream.flush()  # or the child would print it again
        its_input, ours = os.pipe()
        from_it, its_output = os.pipe()
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)  # our handlers are not the child's
        self.pid = os.fork()
        if self.pid == 0:
            _become(command, its_input, its_output, messages, blocked)
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        os.close(its_input)
        os.close(its_output)
        self.stdin: IO[bytes] = os.fdopen(ours, "wb")
        self.stdout: IO[bytes] = os.fdopen(from_it, "rb")
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """The exit code; negative: the signal that ended it; None: it runs."""
        if self.returncode is None:
            ended, status = os.waitpid(self.pid, os.WNOHANG)
            if ended:
                self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end; raises subprocess.TimeoutExpired after so many s."""
        deadline = None if timeout is None else time.monotonic() + timeout
        pause = 0.0005
        while (code := self.poll()) is None:
            if deadline is not None and time.monotonic() >= deadline:
                raise subprocess.TimeoutExpired("sitl", timeout or 0.0)
            time.sleep(pause)
            pause = min(2.0 * pause, _LONGEST_WAIT)
        return code

    def terminate(self) -> None:
        """Ask it to stop."""
        if self.poll() is None:
            os.kill(self.pid, signal.SIGTERM)

    def kill(self) -> None:
        """End it."""
        if self.poll() is None:
            os.kill(self.pid, signal.SIGKILL)


def _become(
    command: Sequence[str], its_input: int, its_output: int, messages: int | None, mask: set[Any]
) -> NoReturn:
    """The child's side of a fork: run a command as an interpreter of its own would, and end."""
    code = 1
    try:
        os.dup2(its_input, 0)
        os.dup2(its_output, 1)
        if messages is not None:
            os.dup2(messages, 2)
        os.closerange(3, os.sysconf("SC_OPEN_MAX"))  # the parent's; and the other child's pipes
        sys.stdin = os.fdopen(0, closefd=False)
        sys.stdout = os.fdopen(1, "w", closefd=False)
        sys.stderr = os.fdopen(2, "w", buffering=1, errors="backslashreplace", closefd=False)
        for number in _SIGNALS:
            signal.signal(number, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        _show_as(["sitl", *command])
        sys.argv[1:] = command
        from sitl.entry import main

        code = main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                stream.flush()
        os._exit(code)


def _show_as(command: Sequence[str]) -> None:
    """Have `ps` and the like show this command, as far as there is room for it."""
    with suppress(OSError, ValueError, IndexError):
        fields = Path("/proc/self/stat").read_text().rpartition(")")[2].split()
        start, end = int(fields[45]), int(fields[46])  # where the kernel reads it
        text = b"\0".join(map(os.fsencode, command))[: end - start - 1]
        ctypes.memmove(start, text.ljust(end - start, b"\0"), end - start)
