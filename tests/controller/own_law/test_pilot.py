"""What a law is given: the estimate of eq. 31 in parts, and the reference with its derivatives."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from controller.law.reference import circle
from controller.own_law.find import ChosenLaw
from controller.own_law.interface import Estimate, LawError, Reference
from controller.own_law.pilot import OwnLawPilot, estimate_of
from sitl_bridge.vehicle.files import load_vehicle

PAPER = load_vehicle("paper")
HOVER = np.zeros(18)
HOVER[2] = PAPER.hover_length


class Hover:
    """Returns what carries the vehicle at rest, and keeps what it was given."""

    def __init__(self, *, vehicle: Any, rate_hz: float) -> None:
        self.given: list[tuple[Estimate, Reference]] = []

    def step(self, estimate: Estimate, reference: Reference) -> Any:
        self.given.append((estimate, reference))
        return PAPER.hover_thrust, (0.0, 0.0, 0.0)


def pilot_of(law: Any) -> tuple[OwnLawPilot, np.ndarray]:
    controls = np.zeros(16)

    def path_from(load: Any) -> Any:
        return circle((0.0, 0.0, 0.0), 2.0, 0.5, load)

    return OwnLawPilot(ChosenLaw("Law", law), PAPER, 250.0, path_from, controls), controls


def test_hover_thrust_is_that_of_eq_24() -> None:
    pilot, controls = pilot_of(Hover)
    pilot.step(HOVER, 0, 0.0)
    rotor = PAPER.rotors[0]
    speed = np.sqrt(PAPER.hover_thrust / 4.0 / rotor.thrust_coefficient)
    np.testing.assert_allclose(controls[:4], speed / rotor.max_speed, rtol=1e-12)
    assert pilot.armed


def test_the_reference_has_its_own_derivatives() -> None:
    made: list[Hover] = []

    def make(**given: Any) -> Hover:
        made.append(Hover(**given))
        return made[-1]

    pilot, _ = pilot_of(make)
    for _ in range(2500):
        pilot.step(HOVER, 0, 0.0)
    references = [reference for _, reference in made[-1].given]
    for rows in (slice(200, 300), slice(2300, 2400)):  # on the smooth way there, and on the circle
        for low, high in zip(Reference._fields[1:5], Reference._fields[2:6], strict=True):
            values, slopes = (np.array([getattr(r, name) for r in references[rows]]) for name in (low, high))
            found = (values[2:] - values[:-2]) * 125.0
            np.testing.assert_allclose(found, slopes[1:-1], atol=2e-3 * max(1.0, np.abs(slopes).max()))
    last = references[-1]
    np.testing.assert_allclose(last.position, last.goal, atol=1e-12)
    np.testing.assert_allclose(
        last.position, 2.0 * np.array([np.sin(0.5 * last.time_s), np.cos(0.5 * last.time_s), 0])
    )


@given(st.lists(st.floats(-3.0, 3.0), min_size=18, max_size=18))
def test_the_parts_of_an_estimate_agree(values: list[float]) -> None:
    state = np.array(values)
    state[16] /= 2.0
    seen = estimate_of(state, 0.0, PAPER.cable)
    np.testing.assert_allclose(seen.rotation @ seen.rotation.T, np.eye(3), atol=1e-12)
    r = seen.rotation
    found = np.arctan2(r[2, 1], r[2, 2]), -np.arcsin(r[2, 0]), np.arctan2(r[1, 0], r[0, 0])
    np.testing.assert_allclose(np.cos(found), np.cos(seen.attitude), atol=1e-6)
    np.testing.assert_allclose(
        seen.position + seen.cable_length * seen.cable_direction,
        seen.load_position if seen.cable_length else seen.position,
        atol=1e-9,
    )
    seen.position[:] = 99.0
    assert state[0] == values[0]


def test_hover_tension_is_the_loads_weight() -> None:
    tension = estimate_of(HOVER, 0.0, PAPER.cable).cable_tension
    np.testing.assert_allclose(tension, PAPER.load.mass * PAPER.gravity, rtol=1e-12)


def test_after_a_failure_the_rotors_stay_stopped() -> None:
    class Fails(Hover):
        def step(self, estimate: Estimate, reference: Reference) -> Any:
            if estimate.time_s >= 0.02:
                raise ValueError("two\nlines")
            return super().step(estimate, reference)

    pilot, controls = pilot_of(Fails)
    for _ in range(10):
        pilot.step(HOVER, 0, 0.0)
    assert not pilot.armed
    np.testing.assert_array_equal(controls, 0.0)
    assert isinstance(pilot.failure, LawError)
    text = str(pilot.failure)
    assert "ValueError: two lines (test_pilot.py, line " in text
    assert "t = 0.020 s" in text
    pilot.disarm()
    pilot.step(HOVER, 0, 0.0)
    assert not pilot.armed


def test_a_new_flight_has_a_new_object() -> None:
    made: list[Hover] = []

    def make(**given: Any) -> Hover:
        made.append(Hover(**given))
        return made[-1]

    pilot, _ = pilot_of(make)
    pilot.step(HOVER, 0, 0.0)
    pilot.disarm()
    pilot.disarm()
    pilot.step(HOVER, 0, 0.0)
    assert [len(law.given) for law in made] == [1, 1]
    assert made[1].given[0][0].time_s == 0.0
