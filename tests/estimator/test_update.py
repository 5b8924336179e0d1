"""The update of one scalar as plain Python, against the Kalman filter's formulas on whole matrices."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controller.estimator.correct import update
from controller.estimator.records import (
    ATTITUDE,
    CLONE_SIZE,
    ERROR_SIZE,
    LOAD,
    LOAD_ON_CABLE,
    LOAD_ON_GROUND,
    NOMINAL_SIZE,
    RATES,
    X_ATTITUDE,
    X_LOAD,
    X_RATES,
    Array,
)

WIDTH = 12
"""Columns of remembered quantities in use: two instants."""
WITHIN = slice(0, WIDTH)


def record(seed: int = 1) -> Any:
    """A filter with a random covariance of error state and remembered quantities, and no correction yet."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(ERROR_SIZE + WIDTH, 60))
    joint = root @ root.T / 60.0
    f = SimpleNamespace(
        p=SimpleNamespace(),
        m=SimpleNamespace(clone_width=WIDTH, adrift=False, slip=np.zeros(6), load_mode=LOAD_ON_GROUND),
        x=rng.normal(size=NOMINAL_SIZE),
        P=joint[:ERROR_SIZE, :ERROR_SIZE].copy(),
        z=rng.normal(size=CLONE_SIZE),
        Pxz=np.full((ERROR_SIZE, CLONE_SIZE), 7.0),
        Pzz=np.full((CLONE_SIZE, CLONE_SIZE), 7.0),
        vectors=rng.normal(size=(8, CLONE_SIZE)),  # of whatever was there before
        row_index=np.zeros(ERROR_SIZE, np.int64),
        row_value=np.zeros(ERROR_SIZE),
    )
    f.Pxz[:, WITHIN] = joint[:ERROR_SIZE, ERROR_SIZE:]
    f.Pzz[WITHIN, WITHIN] = joint[ERROR_SIZE:, ERROR_SIZE:]
    f.x[X_ATTITUDE:X_RATES] /= np.linalg.norm(f.x[X_ATTITUDE:X_RATES])
    update.begin(f)
    return f


def joint_of(f: Any) -> Array:
    """Covariance (34 + 12,) of the error state and the remembered quantities in use."""
    return np.block([[f.P, f.Pxz[:, WITHIN]], [f.Pxz[:, WITHIN].T, f.Pzz[WITHIN, WITHIN]]])


def correction_of(f: Any) -> Array:
    return np.concatenate(
        [f.vectors[update.CORRECTION, :ERROR_SIZE], f.vectors[update.CORRECTION_CLONES, WITHIN]]
    )


def taken_in(
    joint: Array, correction: Array, h: Array, innovation: float, noise: float
) -> tuple[Array, Array, float]:
    """Covariance, correction and normalised innovation squared after one scalar: Joseph's form."""
    variance = h @ joint @ h + noise
    gain = joint @ h / variance
    left = innovation - h @ correction
    keep = np.eye(len(h)) - np.outer(gain, h)
    return keep @ joint @ keep.T + noise * np.outer(gain, gain), correction + gain * left, left**2 / variance


def row(f: Any, entries: dict[int, float]) -> Array:
    """Write the row h; returns it for the joint state."""
    h = np.zeros(ERROR_SIZE + WIDTH)
    for index, value in entries.items():
        f.vectors[update.ROW, index] = h[index] = value
    return h


def test_a_measurement_begins_with_nothing() -> None:
    f = record()
    assert (f.vectors[update.ROW, :ERROR_SIZE] == 0.0).all()
    assert (f.vectors[update.CORRECTION, :ERROR_SIZE] == 0.0).all()
    assert (f.vectors[update.CORRECTION_CLONES] == 0.0).all()


def test_the_entries_of_a_row_are_listed_in_order_and_the_row_is_cleared() -> None:
    f = record()
    row(f, {0: 0.5, 7: -2.0, ERROR_SIZE - 1: 1e-30})
    assert update.collect(f) == 3
    assert f.row_index[:3].tolist() == [0, 7, ERROR_SIZE - 1]
    assert f.row_value[:3].tolist() == [0.5, -2.0, 1e-30]
    assert (f.vectors[update.ROW, :ERROR_SIZE] == 0.0).all()
    assert update.collect(f) == 0


def test_predicted_variance() -> None:
    f = record()
    h = row(f, {0: 0.5, 7: -2.0, 33: 1.5})
    assert update.predicted_variance(f) == pytest.approx(h @ joint_of(f) @ h)
    assert update.predicted_variance(f) == 0.0  # the row has been used up


def test_three_scalars_one_after_the_other() -> None:
    """Each sees what those before it have corrected; all of the covariance is that of Joseph's form."""
    f = record()
    joint, correction = joint_of(f), np.zeros(ERROR_SIZE + WIDTH)
    for entries, innovation, noise in (
        ({0: 1.0, 7: -2.0, 33: 1.5}, 0.7, 0.3),
        ({3: 1.0}, -1.1, 1e-3),
        ({0: 2.0, 20: 0.25}, 0.4, 2.0),
    ):
        h = row(f, entries)
        squared = update.fuse(f, innovation, noise)
        joint, correction, expected = taken_in(joint, correction, h, innovation, noise)
        assert squared == pytest.approx(expected, rel=1e-9)
        np.testing.assert_allclose(
            joint_of(f)[:ERROR_SIZE, :ERROR_SIZE], joint[:ERROR_SIZE, :ERROR_SIZE], atol=1e-9
        )
        np.testing.assert_allclose(joint_of(f), joint, atol=1e-9)
        np.testing.assert_allclose(correction_of(f), correction, atol=1e-9)
        assert (f.vectors[update.ROW, :ERROR_SIZE] == 0.0).all()
    assert (f.Pxz[:, WIDTH:] == 7.0).all()  # what is not in use stays as it is
    assert (f.Pzz[WIDTH:, WIDTH:] == 7.0).all()
    assert (f.vectors[update.CORRECTION_CLONES, WIDTH:] == 0.0).all()


def test_remembered_quantities_and_sums_of_them_are_measured() -> None:
    f = record()
    joint, correction = joint_of(f), np.zeros(ERROR_SIZE + WIDTH)
    for index, also, innovation, noise in ((4, 4, 0.7, 0.3), (11, 11, -0.2, 0.05), (7, 1, 0.4, 0.1)):
        h = np.zeros(ERROR_SIZE + WIDTH)
        h[ERROR_SIZE + index] = h[ERROR_SIZE + also] = 1.0
        assert update.remembered_variance(f, index, also) == pytest.approx(h @ joint @ h)
        squared = update.fuse_remembered(f, index, also, innovation, noise)
        joint, correction, expected = taken_in(joint, correction, h, innovation, noise)
        assert squared == pytest.approx(expected, rel=1e-9)
        np.testing.assert_allclose(joint_of(f), joint, atol=1e-9)
        np.testing.assert_allclose(correction_of(f), correction, atol=1e-9)


def test_a_very_sharp_scalar_taken_in_twice_leaves_the_covariance_positive() -> None:
    """To rounding: it is sharper than what was known by fifteen orders of magnitude."""
    f = record()
    f.P *= 1e6
    for _ in range(2):
        row(f, {0: 1.0, 1: 1.0, 2: 1.0})
        update.fuse(f, 0.0, 1e-9)
    symmetric = 0.5 * (f.P + f.P.T)
    assert np.linalg.eigvalsh(symmetric).min() > -1e-6
    assert np.diag(f.P).min() > 0.0


# Injection


def corrected(f: Any, seed: int = 5, scale: float = 0.1) -> Array:
    """Write a random correction; returns that of the error state."""
    rng = np.random.default_rng(seed)
    f.vectors[update.CORRECTION, :ERROR_SIZE] = scale * rng.normal(size=ERROR_SIZE)
    f.vectors[update.CORRECTION_CLONES] = scale * rng.normal(size=CLONE_SIZE)
    return f.vectors[update.CORRECTION, :ERROR_SIZE].copy()


def test_corrections_are_added_and_the_attitude_is_turned_in_the_body() -> None:
    f = record()
    correction, x, z = corrected(f), f.x.copy(), f.z.copy()
    update.inject(f)
    np.testing.assert_allclose(f.x[:X_ATTITUDE], x[:X_ATTITUDE] + correction[:ATTITUDE])
    np.testing.assert_allclose(f.x[X_RATES:], x[X_RATES:] + correction[RATES:])
    before, after = (Rotation.from_quat(q[X_ATTITUDE:X_RATES], scalar_first=True) for q in (x, f.x))
    turned = (before.inv() * after).as_rotvec()
    np.testing.assert_allclose(turned, correction[ATTITUDE:RATES], atol=1e-12)
    moved = f.vectors[update.CORRECTION_CLONES, WITHIN]
    np.testing.assert_allclose(f.z[WITHIN], z[WITHIN] + moved)
    np.testing.assert_array_equal(f.z[WIDTH:], z[WIDTH:])
    np.testing.assert_array_equal(f.m.slip, 0.0)


def test_what_moves_a_vehicle_adrift_is_remembered() -> None:
    f = record()
    f.m.adrift = True
    f.m.slip[:3] = 1.0, 2.0, 3.0
    correction = corrected(f)
    update.inject(f)
    np.testing.assert_allclose(f.m.slip[:3], np.add(correction[:3], (1.0, 2.0, 3.0)))
    np.testing.assert_array_equal(f.m.slip[3:], 0.0)


def swinging(correction: Array) -> tuple[Any, Array, Array, Array, Array]:
    """Inject a correction of a load that hangs 1.5 m below: filter, load before, P, Pxz and rotation."""
    f = record(3)
    f.m.load_mode = LOAD_ON_CABLE
    before = 1.5 * np.array([0.36, -0.48, -0.8])
    f.x[X_LOAD : X_LOAD + 3] = before
    f.vectors[update.CORRECTION, LOAD : LOAD + 3] = correction
    P, Pxz = f.P.copy(), f.Pxz.copy()
    update.inject(f)
    along = before / 1.5
    across = correction - (along @ correction) * along
    angle = np.linalg.norm(across) / 1.5
    axis = np.cross(along, across)
    turn = Rotation.from_rotvec(angle * axis / max(np.linalg.norm(axis), 1e-300)).as_matrix()
    return f, before, P, Pxz, np.asarray(turn)


def test_a_hanging_load_is_turned_and_stretched() -> None:
    correction = np.array([0.3, 0.2, 0.1])
    f, before, P, Pxz, turn = swinging(correction)
    length = 1.5 + correction @ before / 1.5
    np.testing.assert_allclose(f.x[X_LOAD : X_LOAD + 3], length * turn @ before / 1.5, atol=1e-8)
    whole = np.eye(ERROR_SIZE)
    whole[LOAD : LOAD + 3, LOAD : LOAD + 3] = turn
    np.testing.assert_allclose(f.P, whole @ P @ whole.T, atol=1e-8)
    np.testing.assert_array_equal(f.P, f.P.T)
    np.testing.assert_allclose(f.Pxz[:, WITHIN], whole @ Pxz[:, WITHIN], atol=1e-8)
    np.testing.assert_array_equal(f.Pxz[:, WIDTH:], 7.0)


def test_a_correction_along_the_cable_turns_nothing() -> None:
    along = np.array([0.36, -0.48, -0.8])
    f, _, P, _, _ = swinging(0.2 * along)
    np.testing.assert_allclose(f.x[X_LOAD : X_LOAD + 3], 1.7 * along, atol=1e-8)
    np.testing.assert_array_equal(f.P, P)


def test_a_load_that_does_not_hang_is_moved_straight() -> None:
    f = record(3)
    before, P = f.x[X_LOAD : X_LOAD + 3].copy(), f.P.copy()
    f.vectors[update.CORRECTION, LOAD : LOAD + 3] = 0.3, 0.2, 0.1
    update.inject(f)
    np.testing.assert_allclose(f.x[X_LOAD : X_LOAD + 3], np.add(before, (0.3, 0.2, 0.1)))
    np.testing.assert_array_equal(f.P, P)


@pytest.mark.parametrize(("angle", "turns"), [(0.99, False), (1.01, True)])
def test_a_turn_too_small_to_matter_is_left_out(angle: float, turns: bool) -> None:
    across = 1.5 * angle * update.SMALLEST_SWING * np.array([0.8, 0.6, 0.0])  # at right angles to the cable
    f, _, P, _, _ = swinging(across)
    assert math.isclose(np.linalg.norm(across), 1.5 * angle * 1e-6)
    assert (f.P != P).any() == turns


def test_a_part_is_forgotten() -> None:
    f = record()
    P, Pxz = f.P.copy(), f.Pxz.copy()
    update.set_part(f, 12, 3, 0.5)
    part, others = slice(12, 15), np.r_[0:12, 15:ERROR_SIZE]
    np.testing.assert_array_equal(f.P[part, part], 0.25 * np.eye(3))
    np.testing.assert_array_equal(f.P[part][:, others], 0.0)
    np.testing.assert_array_equal(f.P[others][:, part], 0.0)
    np.testing.assert_array_equal(f.Pxz[part], 0.0)
    np.testing.assert_array_equal(f.P[np.ix_(others, others)], P[np.ix_(others, others)])
    np.testing.assert_array_equal(f.Pxz[others], Pxz[others])
