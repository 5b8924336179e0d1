"""Commands that act late, which nobody tells: found out in flight, and flown."""

from __future__ import annotations

import numpy as np
import pytest

import sitl
from sitl.flights.scenario import Scenario, load_scenario
from sitl.report.outcome import FELL

FOUND = "ticks late: the gains are for that now"


@pytest.mark.parametrize("feedback", ["estimate", "truth"])
@pytest.mark.parametrize("vehicle", ["iris", "heavy", "paper"])
def test_80_ms_that_nobody_tells_of(vehicle: str, feedback: str) -> None:
    flight = sitl.fly(
        "setpoint",
        vehicle=vehicle,
        feedback=feedback,
        overrides=["sensors.preset=consumer"],
        plant_overrides=["loop.delay_ticks=20"],
        seed=1,
        duration_s=12.0,
    )
    assert flight.summary["outcome"] not in FELL
    assert any(FOUND in text for text in flight.said)
    qx, qy = flight.states["attitude_qx"], flight.states["attitude_qy"]
    tilt_deg = np.degrees(np.arccos(1.0 - 2.0 * (qx**2 + qy**2)))
    assert np.max(tilt_deg[flight.states["time_s"] > 8.0]) < 20.0


@pytest.mark.parametrize(
    "unknown",
    [
        ["loop.delay_ticks=2"],
        ["disturbance.force_std=5"],
        ["load.mass=0.36", "cable.rest_length=1.35"],
        ["air.wind=[8, 0, 0]", "air.turbulence.wind_at_6_m=15"],
    ],
)
@pytest.mark.parametrize("feedback", ["estimate", "truth"])
def test_nothing_else_is_taken_for_it(unknown: list[str], feedback: str) -> None:
    flight = sitl.fly(
        "setpoint", vehicle="iris", feedback=feedback, plant_overrides=unknown, seed=2, duration_s=10.0
    )
    assert not [text for text in flight.said if FOUND in text]


@pytest.mark.parametrize("length", [1, 10])
@pytest.mark.parametrize("ticks", [3, 4, 5, 6, 8])
def test_on_truth_a_short_delay_misleads_nothing(ticks: int, length: int) -> None:
    """20 ms that nobody told of were taken for a heavier load and a softer cable, and the load was lost."""
    flight = sitl.fly(
        scenario(),
        overrides=[f"cable.rest_length={length}"],
        plant_overrides=[f"loop.delay_ticks={ticks}"],
        duration_s=12.0,
    )
    assert flight.summary["outcome"] not in FELL
    assert flight.summary["settled"]
    assert any(FOUND in text for text in flight.said)


def test_the_papers_design_stays_what_it_is() -> None:
    flight = sitl.fly(scenario(), design="paper", plant_overrides=["loop.delay_ticks=5"], duration_s=5.0)
    assert not [text for text in flight.said if FOUND in text]


def scenario() -> Scenario:
    shipped = load_scenario("setpoint")
    reference = shipped.reference.model_copy(update={"position": (1.0, 1.6, 0.7)})
    return shipped.model_copy(update={"reference": reference})
