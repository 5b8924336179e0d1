"""How stiff a law on truth is made: as far as margin and rotors let it."""

from __future__ import annotations

import numpy as np

from controller.design.catalogue import (
    EVEN,
    MOST_STIFF,
    STIFFEST,
    default_weights,
    design,
    design_for,
    stiffened,
    stiffness,
    times,
)
from controller.design.margins import delay_margin
from controller.design.model import actuated_model
from controller.design.stiffness import FASTEST, MARGIN, bears, lag_in_answer, stiffest
from controller.law.control_law import FEEDFORWARD
from tests.controller.fleet import FLEET, delayed

RATE = 250.0


def test_the_stiffest_that_is_good_is_found_by_halving() -> None:
    asked: list[float] = []

    def good(share: float) -> bool:
        asked.append(share)
        return share <= 0.4

    assert stiffest(good, 1.0) == 0.375
    assert asked == [1.0, 0.5, 0.25, 0.375, 0.4375]
    assert stiffest(lambda _: True, 0.5) == 0.5
    assert stiffest(lambda _: False, 1.0) == 0.0


def test_factors_go_from_even_to_the_stiffest() -> None:
    assert stiffened(0.0) == EVEN
    assert stiffened(1.0) == STIFFEST
    half = stiffened(0.5)
    np.testing.assert_allclose(times(half, half), STIFFEST)


def test_what_is_chosen_keeps_margin_and_rotors_and_little_more_would_not() -> None:
    vehicle, rate_hz = delayed(FLEET["tiny, heavy load"], 2), 50.0
    model, chosen = actuated_model(vehicle), stiffness(vehicle, rate_hz)

    def kept(share: float) -> bool:
        record = design_for(vehicle, rate_hz, default_weights(vehicle, stiffened(share)), FEEDFORWARD)
        return lag_in_answer(record, vehicle.gravity) <= FASTEST and bears(model, record, MARGIN)

    assert 0.0 < chosen < MOST_STIFF
    assert kept(chosen)
    assert not kept(chosen + 0.0625)


def test_slow_rotors_on_a_long_cable_get_no_stiffer_law() -> None:
    assert stiffness(FLEET["large, lag"], RATE) == 0.0
    assert stiffness(FLEET["large"], RATE) == MOST_STIFF


def test_what_bears_a_delay_has_that_margin() -> None:
    vehicle = FLEET["small"]
    model, record = actuated_model(vehicle), design("geometric", vehicle, RATE)
    least = min(delay_margin(model, record, (i,)) for i in range(4))
    assert bears(model, record, 0.99 * least)
    assert not bears(model, record, 1.02 * least)


def test_a_stiffer_law_answers_the_load_faster() -> None:
    vehicle = FLEET["large, lag"]
    answers = [
        lag_in_answer(
            design_for(vehicle, RATE, default_weights(vehicle, stiffened(share)), FEEDFORWARD),
            vehicle.gravity,
        )
        for share in (0.0, 0.5, 1.0)
    ]
    assert answers == sorted(answers)
    assert lag_in_answer(design("default", FLEET["paper"], RATE), 9.81) == 0.0  # rotors without lag
