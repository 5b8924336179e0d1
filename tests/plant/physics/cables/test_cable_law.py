"""The kernels of the elastic cable by themselves, as plain Python: force, slack and taut, breaking."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sitl_bridge.plant.physics.cables import cable
from sitl_bridge.plant.physics.cables.flexible_cable import CHAIN, LINEAR, PROGRESSIVE
from sitl_bridge.plant.physics.state import CABLE_HOLDS, CABLE_STATE, INNER_SIZE, STATE_SIZE, Array

DIRECTION = np.array([2.0, -3.0, 6.0]) / 7.0


def figures(**changes: Any) -> Any:
    """k_a = 200 N/m, c_a = 5 N s/m, l_0 = 1.5 m."""
    return SimpleNamespace(
        **{
            "stiffness": 200.0,
            "damping": 5.0,
            "rest_length": 1.5,
            "reel_rate": 0.0,
            "two_way": False,
            "cable_kind": LINEAR,
            "breaking_tension": math.inf,
            **changes,
        }
    )


def state(length: float, rate: float = 0.0, sideways: float = 0.0) -> Array:
    """A load so far from the vehicle along `DIRECTION`, going away at `rate` and across at `sideways`."""
    x = np.zeros(STATE_SIZE)
    x[0:3] = 4.0, -5.0, 6.0
    x[3:6] = 0.3, 0.2, -0.1
    x[13:16] = x[0:3] + length * DIRECTION
    across = np.cross(DIRECTION, (1.0, 0.0, 0.0))
    x[16:19] = x[3:6] + rate * DIRECTION + sideways * across
    return x


def whole() -> Array:
    inner = np.zeros(INNER_SIZE)
    inner[CABLE_HOLDS] = 1.0
    return inner


def test_force_of_spring_and_damper() -> None:
    assert cable.spring_and_damper(figures(), 1.75, 0.0) == 50.0
    assert cable.spring_and_damper(figures(), 1.75, -2.0) == 40.0
    assert cable.spring_and_damper(figures(), 1.25, 0.0) == -50.0
    assert cable.spring_and_damper(figures(reel_rate=0.5), 1.75, 2.0) == 57.5  # against the winch


def test_length_and_rate_of_a_state() -> None:
    x = state(3.5, 0.7, sideways=9.0)
    dx, dy, dz, length = cable.span(x)
    np.testing.assert_allclose((dx, dy, dz), 3.5 * DIRECTION)
    assert length == pytest.approx(3.5)
    assert cable.stretch(x) == pytest.approx((3.5, 0.7))
    assert cable.stretch(state(0.25, -0.7)) == pytest.approx((0.25, -0.7))
    x[13:16] = x[0:3]
    assert cable.stretch(x) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("length", "rate", "margin", "pull"),
    [
        (1.75, 0.0, 50.0, 50.0),
        (1.5025, 0.0, 0.5, 0.5),
        (1.4975, 0.0, -0.5, 0.0),
        (1.75, 2.0, 50.0, 60.0),  # the damper adds to the pull, not to the margin
        (1.75, -2.0, 40.0, 40.0),
        (1.75, -11.0, -5.0, 0.0),  # longer than l_0, but closing so fast that it would push
        (1.25, 0.0, -50.0, 0.0),
        (1.25, 12.0, -50.0, 0.0),  # shorter than l_0, whatever the damper says
        (1.5, 3.0, 0.0, 0.0),
    ],
)
def test_a_cable_that_cannot_push_pulls_only_where_spring_and_sum_do(
    length: float, rate: float, margin: float, pull: float
) -> None:
    p, x = figures(), state(length, rate)
    assert cable.taut_margin(p, length, rate) == pytest.approx(margin)
    assert cable.tension(p, length, rate) == pytest.approx(pull)
    assert cable.taut_margin_of(p, x) == pytest.approx(margin, abs=1e-9)
    if margin != 0.0:
        assert cable.is_taut(p, x, whole()) == (margin > 0.0)
    assert cable.tension(figures(two_way=True), length, rate) == cable.spring_and_damper(p, length, rate)


def test_on_the_verge_a_cable_is_slack() -> None:
    x = np.zeros(STATE_SIZE)
    x[15], x[18] = -1.5, -3.0
    assert cable.taut_margin_of(figures(), x) == 0.0
    assert not cable.is_taut(figures(), x, whole())
    assert cable.is_taut(figures(two_way=True), x, whole())


def test_a_two_way_cable_is_always_taut_and_one_that_is_gone_never() -> None:
    gone = np.zeros(INNER_SIZE)
    for p in (figures(), figures(two_way=True)):
        assert not cable.is_taut(p, state(1.75), gone)
        assert not cable.goes_slack(p, gone)
        assert cable.tension_of(p, state(1.75), gone) == 0.0
    assert cable.is_taut(figures(two_way=True), state(0.5), whole())
    assert cable.goes_slack(figures(), whole())
    assert not cable.goes_slack(figures(two_way=True), whole())


@pytest.mark.parametrize("kind", [PROGRESSIVE, CHAIN])
def test_other_kinds_of_cable_are_no_spring_and_damper(kind: int) -> None:
    p = figures(cable_kind=kind)
    assert not cable.is_taut(p, state(1.75), whole())
    assert not cable.goes_slack(p, whole())


def test_the_force_pulls_the_vehicle_towards_the_load() -> None:
    force = cable.taut_force(figures(), state(1.75, -2.0, sideways=9.0))
    np.testing.assert_allclose(force, 40.0 * DIRECTION)
    force = cable.taut_force(figures(), state(1.25))  # held taut within a step
    np.testing.assert_allclose(force, -50.0 * DIRECTION)


def test_tension_of_a_state() -> None:
    assert cable.tension_of(figures(), state(1.75, 2.0), whole()) == pytest.approx(60.0)
    assert cable.tension_of(figures(), state(1.25), whole()) == 0.0
    assert cable.tension_of(figures(two_way=True), state(1.25), whole()) == pytest.approx(-50.0)


def test_tension_of_a_rope_is_that_of_its_strain() -> None:
    """Without branches: T = s (exp(r e) - 1), e = l / l_0 - 1."""
    p = figures(cable_kind=PROGRESSIVE, curve_scale=10.0, curve_rate=3.0, branch_weight=np.zeros(8))
    expected = 10.0 * math.expm1(3.0 * (1.8 / 1.5 - 1.0))
    assert cable.tension_of(p, state(1.8, 5.0), whole()) == pytest.approx(expected)


def test_a_rope_remembers_from_its_place_in_the_inner_state() -> None:
    weights = np.zeros(8)
    weights[0] = 0.5
    p = figures(cable_kind=PROGRESSIVE, curve_scale=10.0, curve_rate=3.0, branch_weight=weights)
    inner = whole()
    inner[CABLE_STATE] = 0.1
    static, relaxed = 10.0 * math.expm1(3.0 * 0.2), 10.0 * math.expm1(3.0 * 0.1)
    expected = static + 0.5 * (static - relaxed)
    assert cable.tension_of(p, state(1.8), inner) == pytest.approx(expected)


def test_tension_of_a_chain_is_that_of_its_first_segment() -> None:
    """Of two segments of 0.75 m, each twice as stiff as the whole."""
    p = figures(cable_kind=CHAIN, segments=2)
    inner, x = whole(), state(1.75)
    inner[CABLE_STATE : CABLE_STATE + 3] = x[0:3] + np.array([0.0, 0.0, -0.8])
    inner[CABLE_STATE + 3 : CABLE_STATE + 6] = x[3:6]
    assert cable.tension_of(p, x, inner) == pytest.approx(400.0 * 0.05)


def test_an_overload_breaks_the_cable_and_nothing_less_does() -> None:
    inner, x = whole(), state(1.75)
    bears = cable.tension_of(figures(), x, inner)
    cable.break_overloaded(figures(breaking_tension=bears), x, inner)
    assert inner[CABLE_HOLDS] == 1.0
    cable.break_overloaded(figures(breaking_tension=bears - 1e-9), x, inner)
    assert inner[CABLE_HOLDS] == 0.0
