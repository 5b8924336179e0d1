"""Gains that are designed in another process are those that this one would design, and cost no tick."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterator

import numpy as np
import pytest

from controller.design.catalogue import EVEN, Emphasis, guided_designs
from controller.design.client import DesignProcess
from controller.law.control_law import Design
from sitl_bridge.vehicle.files import load_vehicle

IRIS = load_vehicle("iris", [])
LENGTH = IRIS.cable.rest_length
HEAVY = EVEN._replace(load_position=4.0)


@pytest.fixture
def process() -> Iterator[DesignProcess]:
    made = DesignProcess(IRIS, 250.0)
    yield made
    made.close()


def answer(process: DesignProcess) -> tuple[Design, Design] | str:
    deadline = time.monotonic() + 60.0
    while (result := process.result()) is None:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return result


def assert_designs(found: tuple[Design, Design] | str, emphasis: Emphasis) -> None:
    assert isinstance(found, tuple), found
    for made, expected in zip(found, guided_designs(IRIS, 250.0, emphasis), strict=True):
        # Gains that are zero in theory are rounding, which another process' linear algebra may do otherwise.
        rounding = 1e-12 * np.abs(expected["state_gain"]).max()
        np.testing.assert_allclose(made["state_gain"], expected["state_gain"], atol=rounding)


def test_the_background_designs_the_same(process: DesignProcess) -> None:
    assert process.result() is None
    process.request(HEAVY, LENGTH)
    assert_designs(answer(process), HEAVY)
    assert process.result() is None
    process.request(EVEN, LENGTH)
    assert_designs(answer(process), EVEN)


def test_only_the_last_of_many_requests_is_answered(process: DesignProcess) -> None:
    """A client that turns a knob asks a hundred times a second: none of that waits in a pipe."""
    for step in range(5000):
        process.request(EVEN._replace(attitude=1.0 + step), LENGTH)
    process.request(HEAVY, LENGTH)
    assert_designs(answer(process), HEAVY)
    assert process.result() is None


def test_in_flight_no_process_is_started(process: DesignProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subprocess, "Popen", lambda *_: pytest.fail("started a process in flight"))
    process.request(HEAVY, LENGTH)
    assert_designs(answer(process), HEAVY)


def test_weights_without_a_design_and_a_process_that_is_gone_are_said(process: DesignProcess) -> None:
    process.request(EVEN._replace(thrust=float("nan")), LENGTH)
    assert "nearer to 1" in str(answer(process))
    process._process.kill()
    process._process.wait()
    process.request(HEAVY, LENGTH)
    assert "start the controller again" in str(answer(process))
    process.request(EVEN, LENGTH)  # and again, without an exception
