"""Gains that are designed in another process are those that this one would design."""

from __future__ import annotations

import time

import numpy as np

from controller.designs import EVEN, guided_designs
from controller.redesign import DesignProcess
from sitl_bridge.vehicle import load_vehicle


def test_the_background_designs_the_same() -> None:
    vehicle, emphasis = load_vehicle("iris", []), EVEN._replace(load_position=4.0)
    process = DesignProcess(vehicle, 250.0)
    process.request(EVEN)
    process.request(emphasis)  # takes the place of the one before
    deadline = time.monotonic() + 60.0
    while (result := process.result()) is None and time.monotonic() < deadline:
        time.sleep(0.05)
    assert isinstance(result, tuple), result
    for found, expected, usual in zip(
        result, guided_designs(vehicle, 250.0, emphasis), guided_designs(vehicle, 250.0), strict=True
    ):
        # Gains that are zero in theory are rounding, which another process' linear algebra may do otherwise.
        rounding = 1e-12 * np.abs(expected["state_gain"]).max()
        np.testing.assert_allclose(found["state_gain"], expected["state_gain"], atol=rounding)
        assert np.abs(found["state_gain"] - usual["state_gain"]).max() > 0.1
    assert process.result() is None
