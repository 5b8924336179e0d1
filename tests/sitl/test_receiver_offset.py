"""A receiver that is metres off at the start of a hover moves the vehicle smoothly."""

from __future__ import annotations

import numpy as np
import pytest

import sitl


@pytest.mark.parametrize("seed", [1, 2])
def test_a_hover_on_urban_sensors_begins_upright(seed: int) -> None:
    flight = sitl.fly(
        "hover",
        vehicle="heavy",
        feedback="estimate",
        overrides=["sensors.preset=urban", 'initial.start="hover"', "initial.load_position=[0,0,30]"],
        seed=seed,
        duration_s=20.0,
    )
    qx, qy = flight.states["attitude_qx"], flight.states["attitude_qy"]
    tilt_deg = np.degrees(np.arccos(1.0 - 2.0 * (qx**2 + qy**2)))
    assert flight.states["time_s"][-1] > 19.9
    assert np.max(tilt_deg) < 45.0
