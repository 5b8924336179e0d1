"""From one law to another: what the rotors give, and have been told, goes on as it is."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from controller.law.bumpless_transfer import from_wrench, other_body, other_gains
from controller.law.control_law import DESIGN, MEMORY, WORK
from controller.law.state import Array

YAW, DELAY = 0.8, 3


def law(seed: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Design, memory and scratch (1,) of random numbers."""
    rng = np.random.default_rng(seed)
    design, memory, work = (np.zeros(1, dtype=kind) for kind in (DESIGN, MEMORY, WORK))
    for record, names in (
        (design, ("state_gain", "lag_gain", "integral_gain", "past_gain", "hover_wrench")),
        (memory, ("past", "rotors", "integral")),
        (work, ("deviation",)),
    ):
        for name in names:
            record[name] = rng.normal(size=record[name].shape)
    design["delay"] = DELAY
    return design, memory, work


def feedback(design: NDArray[Any], memory: NDArray[Any], work: NDArray[Any]) -> Array:
    """What the law takes off u* (4,): with the integral, which is kept in the world's axes."""
    d, m = design[0], memory[0]
    c, s = math.cos(YAW), math.sin(YAW)
    east, north, up = m["integral"]
    integral = np.array([c * east + s * north, c * north - s * east, up])
    out = d["state_gain"] @ work[0]["deviation"] + d["lag_gain"] @ m["rotors"] + d["integral_gain"] @ integral
    for age in range(DELAY):
        out = out + d["past_gain"][age] @ m["past"][age]
    return np.asarray(out)


def test_to_the_law_of_another_body() -> None:
    """Wrenches stay what they were: each deviation is now one from the other hover."""
    (before, old, _), (after, new, _) = law(1), law(2)
    rotors, past = old["rotors"].copy(), old["past"].copy()
    other_body(before, after, old, new)
    hover, now = before["hover_wrench"][0], after["hover_wrench"][0]
    np.testing.assert_allclose(new["rotors"][0] + now, rotors[0] + hover)
    np.testing.assert_allclose(new["past"][0] + now, past[0] + hover)
    np.testing.assert_array_equal(old["past"], past)


def test_from_a_law_of_another_kind() -> None:
    design, memory, _ = law(1)
    given = np.array([20.0, 0.1, -0.2, 0.3])
    from_wrench(design, given, memory)
    np.testing.assert_allclose(memory["rotors"][0] + design["hover_wrench"][0], given)
    np.testing.assert_allclose(memory["past"][0] + design["hover_wrench"][0], np.tile(given, (64, 1)))


def test_to_other_gains_the_integral_takes_up_all_that_it_can() -> None:
    """What is left over is at right angles to all that an integral can give."""
    (before, memory, work), (after, _, _) = law(1), law(2)
    was = feedback(before, memory, work)
    others = {name: memory[name].copy() for name in ("past", "rotors")}
    other_gains(before, after, memory, work, YAW)
    left = feedback(after, memory, work) - was
    np.testing.assert_allclose(after["integral_gain"][0].T @ left, 0.0, atol=1e-9)
    for name, value in others.items():
        np.testing.assert_array_equal(memory[name], value)


def test_where_the_integral_can_give_all_of_it_nothing_changes() -> None:
    (before, memory, work), (after, _, _) = law(1), law(2)
    for name in ("state_gain", "lag_gain", "past_gain", "integral_gain"):
        for design in (before, after):
            design[name][0][..., 3, :] = 0.0  # nothing about the heading
    was = feedback(before, memory, work)
    other_gains(before, after, memory, work, YAW)
    np.testing.assert_allclose(feedback(after, memory, work), was, atol=1e-9)


@pytest.mark.parametrize("turns", [0, 1])
def test_the_same_gains_change_nothing(turns: int) -> None:
    before, memory, work = law(1)
    integral = memory["integral"].copy()
    other_gains(before, before.copy(), memory, work, YAW + 2 * math.pi * turns)
    np.testing.assert_allclose(memory["integral"], integral, atol=1e-9)
