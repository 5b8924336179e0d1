"""A start in hover on the estimate, in a loop whose delay the controller is told."""

from __future__ import annotations

import pytest

from sitl import fly


@pytest.mark.parametrize(("vehicle", "ticks"), [("paper", 2), ("heavy", 9)])
def test_the_first_delayed_ticks_are_no_fall(vehicle: str, ticks: int) -> None:
    """Rotors go on hovering until the first command arrives: taken as stopped, the load jumps by metres."""
    flight = fly(
        "hover",
        vehicle=vehicle,
        overrides=[f"loop.delay_ticks={ticks}", "sensors.preset=ideal"],
        feedback="estimate",
        duration_s=4.0,
    )
    assert flight.summary["largest_error_at_end_m"] < 0.1
