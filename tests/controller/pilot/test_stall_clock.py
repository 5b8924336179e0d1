"""The clock of a process that may be stopped: intended sleep counts, stalls do not."""

from __future__ import annotations

import math

import pytest

from controller.pilot.stall_clock import StallFreeClock


def test_time_passes_while_it_waits_and_works() -> None:
    clock = StallFreeClock(100.0)
    assert clock.now(100.02, clock.monotonic(100.02)) == 100.02
    assert clock.now(130.0, math.inf) == 130.0  # waited for a datagram
    assert clock.now(130.05, clock.monotonic(130.01)) == 130.05  # a little late


def test_a_stall_takes_no_time_whether_asleep_or_at_work() -> None:
    clock = StallFreeClock(100.0)
    assert clock.now(103.0, clock.monotonic(100.02)) == pytest.approx(100.02)
    assert clock.now(103.01, clock.monotonic(100.04)) == pytest.approx(100.03)
    assert clock.now(105.01, clock.monotonic(100.02)) == pytest.approx(100.03)  # the deadline had passed
    assert clock.monotonic(101.0) == pytest.approx(101.0 + clock.stalled)
    assert clock.stalled == pytest.approx(4.98)
