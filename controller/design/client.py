"""Gains designed in a process of their own, so that the control loop does not miss a tick for them.

The process (`designer`) is started with the controller and waits: to ask it for gains in flight is a write
of a few hundred bytes to a pipe, and its answer is read without waiting for it.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys

import numpy as np

from controller.design.catalogue import Emphasis
from controller.law.control_law import DESIGN, Design
from sitl_bridge.vehicle.description import Vehicle

ANSWER_SIZE = 2 * DESIGN.itemsize
"""Bytes of the two designs; an answer has one in front of them that is 0 if there are none"""


class DesignProcess:
    """Makes the designs of one vehicle in the background, one after the other."""

    def __init__(self, vehicle: Vehicle, rate_hz: float) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "controller.design.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            bufsize=0,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(sys.path)},
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._questions, self._answers = self._process.stdin.fileno(), self._process.stdout.fileno()
        os.set_blocking(self._answers, False)
        self._received = b""
        self._asked: tuple[Emphasis, float] | None = None
        """What the process is at work on"""
        self._wanted: tuple[Emphasis, float] | None = None
        """What is wanted now, if that is something else"""
        self._ask({"vehicle": vehicle.model_dump_json(), "rate_hz": rate_hz})

    def request(self, emphasis: Emphasis, rest_length: float) -> None:
        """Begin to design, for a cable of this length (m); what was wanted before is not any more."""
        self._wanted = (emphasis, rest_length)
        if self._asked is None:
            self._begin()

    def result(self) -> tuple[Design, Design] | str | None:
        """The designs of the last request, once, when they are there; or why there are none."""
        if self._asked is None:
            return None
        try:
            data = os.read(self._answers, 1 + ANSWER_SIZE - len(self._received))
        except BlockingIOError:
            return None
        if not data:
            self._asked = self._wanted = None
            return "the process that designs gains has ended; start the controller again"
        self._received += data
        if self._received[0] and len(self._received) < 1 + ANSWER_SIZE:
            return None
        answer, self._received, self._asked = self._received, b"", None
        if self._wanted is not None:
            self._begin()
            return None
        return _designs_of(answer)

    def _begin(self) -> None:
        self._asked, self._wanted = self._wanted, None
        assert self._asked is not None
        self._ask({"emphasis": self._asked[0], "rest_length": self._asked[1]})

    def _ask(self, what: object) -> None:
        with contextlib.suppress(BrokenPipeError):  # `result` says so
            # One question at a time is in the pipe, which holds far more: this does not block.
            os.write(self._questions, json.dumps(what).encode() + b"\n")

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            pipe.close()


def _designs_of(answer: bytes) -> tuple[Design, Design] | str:
    if not answer[0]:
        return "no gains can be designed with them; go back to weights nearer to 1"
    designs = np.frombuffer(answer, dtype=DESIGN, offset=1).copy()
    if not all(np.isfinite(designs[name]).all() for name in ("state_gain", "integral_gain", "lag_gain")):
        return "their gains are not finite; go back to weights nearer to 1"
    return designs[:1], designs[1:]
