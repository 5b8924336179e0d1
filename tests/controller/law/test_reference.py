"""Reference paths: all their derivatives, where they begin, and how they join the path."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.law.reference import (
    DERIVATIVES,
    LARGEST_ACCELERATION,
    LARGEST_SPEED,
    SHORTEST_RAMP,
    Path,
    circle,
    feasible,
    figure_eight,
    helix,
    path_derivatives,
    setpoint,
)
from controller.law.state import Array
from tests.controller.fleet import attributes

coordinate = st.floats(-20.0, 20.0)
points = st.tuples(coordinate, coordinate, coordinate)
_round = (points, st.floats(0.0, 10.0), st.floats(-2.0, 2.0))
paths = st.one_of(
    st.builds(circle, *_round, points),
    st.builds(figure_eight, *_round, points),
    st.builds(helix, *_round, st.floats(0.0, 3.0), points),
)


def at(path: Path, t: float) -> Array:
    """The feasible path's derivatives (6, 3) at time t."""
    out = np.full((DERIVATIVES + 1, 3), np.nan)
    feasible(attributes(path), t, out, np.zeros(DERIVATIVES + 1))
    return out


def on_path(path: Path, t: float) -> Array:
    """The path's own derivatives (6, 3) at time t."""
    out = np.full((DERIVATIVES + 1, 3), np.nan)
    path_derivatives(attributes(path), t, out)
    return out


@given(paths, st.floats(0.0, 1.5))
def test_each_row_is_the_derivative_of_the_one_before(path: Path, share: float) -> None:
    """By central differences of eighth order."""
    h = 0.02
    weights = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])
    ramp = float(path["ramp_time"][0])
    t = share * ramp
    if min(abs(t - ramp), t) < 5 * h:  # a stencil must not reach across a joint
        t += 12 * h
    for derivatives in (at, on_path):
        ahead = [derivatives(path, t + k * h) for k in range(1, 5)]
        behind = [derivatives(path, t - k * h) for k in range(1, 5)]
        slope = sum(w * (a - b) / h for w, a, b in zip(weights, ahead, behind, strict=True))
        here = derivatives(path, t)
        np.testing.assert_allclose(slope[:-1], here[1:], atol=1e-7 * max(1.0, np.abs(here).max()))


@given(paths)
def test_begins_at_rest_where_the_load_is(path: Path) -> None:
    for t in (-0.004, 0.0):
        expected = np.zeros((DERIVATIVES + 1, 3))
        expected[0] = path["start"][0]
        np.testing.assert_allclose(at(path, t), expected, atol=1e-12)


@given(paths)
def test_joins_the_path_with_every_derivative(path: Path) -> None:
    ramp = float(path["ramp_time"][0])
    before, after = at(path, ramp * (1.0 - 1e-9)), at(path, ramp)
    np.testing.assert_allclose(before, after, atol=1e-4 * max(1.0, np.abs(after).max()))
    np.testing.assert_array_equal(after, on_path(path, ramp))
    np.testing.assert_array_equal(at(path, ramp + 7.0), on_path(path, ramp + 7.0))


@given(points, points)
def test_a_ramp_keeps_to_its_speed_and_acceleration(start: tuple[float, ...], end: tuple[float, ...]) -> None:
    path = setpoint(end, start)  # type: ignore[arg-type]
    ramp = float(path["ramp_time"][0])
    motion = np.array([at(path, t) for t in np.linspace(0.0, ramp, 81)])
    speed, acceleration = (np.linalg.norm(motion[:, k], axis=1).max() for k in (1, 2))
    assert speed <= LARGEST_SPEED * (1 + 1e-9)
    assert acceleration <= LARGEST_ACCELERATION * (1 + 1e-9)
    used = max(speed / LARGEST_SPEED, acceleration / LARGEST_ACCELERATION)
    assert used > 0.99 or ramp == SHORTEST_RAMP  # and takes no longer than that needs


def test_the_papers_circle() -> None:
    path = circle((0.0, 0.0, 5.0), 5.0, 1.0, (0.0, 0.0, 0.0))
    for t in (0.0, 1.0, 20.0):
        expected = [5 * np.sin(t), 5 * np.cos(t), 5.0]
        np.testing.assert_allclose(on_path(path, t)[0], expected, atol=1e-12)
    assert on_path(setpoint((3.0, 5.0, 2.0), (0.0, 0.0, 0.0)), 4.0)[0] == pytest.approx([3, 5, 2])
