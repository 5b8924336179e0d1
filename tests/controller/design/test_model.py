"""The linear model, written down by hand, against derivatives of the plant and against the paper's print."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from controller.design.model import actuated_model, linear_model, rotor_time_constant, with_rotor_lag
from controller.law.allocation import allocation
from controller.law.state import STATE_SIZE
from sitl_bridge.plant.physics import dynamics
from sitl_bridge.plant.physics.parameters import parameters
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.coordinates import paper_state, plant_state
from tests.controller.fleet import FLEET, attributes

Vector = Any  # complex arrays: that is how they are differentiated

TINY = 1e-30


def complex_step(function: Callable[[Vector], Vector], at: Vector) -> Vector:
    """Jacobian by complex steps: exact to rounding, for functions that are analytic where it is taken."""
    columns = []
    for j in range(len(at)):
        x = np.array(at, dtype=complex)
        x[j] += 1j * TINY
        columns.append(function(x).imag / TINY)
    return np.array(columns).T


def hover(vehicle: Vehicle, length: float) -> Vector:
    """State (18,) of a vehicle `length` m straight above the load."""
    x = np.zeros(18)
    x[0:3], x[3:6] = (1.0, -2.0, 4.0 + length), (1.0, -2.0, 4.0)
    return x


def plant_jacobians(vehicle: Vehicle, length: float) -> tuple[Vector, Vector]:
    """A (18, 18), and the derivative (18, rotors) by rotor speeds, of the plant's own equations.

    Upright and without rates the attitude does not change, so the chain rule through both changes of
    coordinates has no further terms.
    """
    p = attributes(parameters(vehicle))
    rotors = len(vehicle.rotors)
    # Rotor speeds whose thrusts carry everything without a moment.
    a = allocation(vehicle)[0]
    speeds = np.zeros(16)
    lift = a["inverse"][:rotors, 0] * vehicle.hover_thrust
    speeds[:rotors] = np.sqrt(lift / a["thrust_coefficient"][:rotors])

    def derivative(x: Vector, rotor_speed: Vector) -> Vector:
        out = np.zeros(19, dtype=complex)
        dynamics.derivative(p, x, rotor_speed, np.zeros(6), out)
        return out

    here = plant_state(hover(vehicle, length)).real
    to_plant = complex_step(plant_state, hover(vehicle, length))
    to_paper = complex_step(paper_state, here)
    by_state = complex_step(lambda x: derivative(x, speeds), here)
    by_speed = complex_step(lambda w: derivative(here.astype(complex), w), speeds)[:, :rotors]
    return to_paper @ by_state @ to_plant, to_paper @ by_speed


OTHER_ROTORS = ["rotors.0.position=[1.2, 0.1, 0]", "rotors.2.position=[-0.9, 0.05, 0.1]"]


@pytest.mark.parametrize(
    "vehicle", [*FLEET.values(), load_vehicle("paper", OTHER_ROTORS)], ids=[*FLEET, "asymmetric"]
)
def test_the_hand_written_jacobian_is_that_of_the_plant(vehicle: Vehicle) -> None:
    for length in (vehicle.hover_length, 1.01 * vehicle.hover_length):
        model = linear_model(vehicle, length)
        a, by_speed = plant_jacobians(vehicle, length)
        np.testing.assert_allclose(model.A, a, rtol=1e-12, atol=1e-12 * np.abs(a).max())
        effect = allocation(vehicle)[0]["effect"][:, : len(vehicle.rotors)]
        coefficients = np.array([rotor.thrust_coefficient for rotor in vehicle.rotors])
        lift = np.linalg.pinv(effect)[:, 0] * vehicle.hover_thrust
        by_thrust = by_speed / (2.0 * np.sqrt(coefficients * lift))  # T = c w², dT = 2 c w dw
        np.testing.assert_allclose(
            model.B @ effect, by_thrust, rtol=1e-11, atol=1e-12 * np.abs(by_thrust).max()
        )


def printed_matrices() -> tuple[Vector, Vector]:
    """A and B as Appendix F1 prints them."""
    rows = {
        6: {0: -5, 3: 5, 16: Fraction(981, 50)},
        7: {1: -5, 4: 5, 15: -Fraction(981, 50)},
        8: {2: -10, 5: 10, 8: -1, 11: 1},
        9: {0: 5, 3: -5},
        10: {1: 5, 4: -5},
        11: {2: 10, 5: -10, 8: 1, 11: -1},
        **{i: {6 + i: 1} for i in range(6)},
        **{15 + i: {12 + i: 1} for i in range(3)},
    }
    a = np.full((18, 18), Fraction(0))
    for i, row in rows.items():
        for j, value in row.items():
            a[i, j] = Fraction(value)
    b = np.full((18, 4), Fraction(0))
    b[8, 0], b[12, 1], b[13, 2], b[14, 3] = Fraction(1, 10), Fraction(100), Fraction(100), Fraction(100)
    return a, b


def test_appendix_f1_at_the_papers_point() -> None:
    a, b = printed_matrices()
    model = linear_model(FLEET["paper"], length=2.0, thrust=196.2)
    np.testing.assert_allclose(model.A, a.astype(float), rtol=0, atol=1e-12)
    np.testing.assert_allclose(model.B, b.astype(float), rtol=0, atol=1e-12)


def test_only_the_pendulum_differs_at_the_true_equilibrium() -> None:
    printed, true = printed_matrices()[0].astype(float), linear_model(FLEET["paper"]).A
    differ = np.argwhere(np.abs(printed - true) > 1e-9)
    assert sorted(map(tuple, differ.tolist())) == [
        *((6, 0), (6, 3), (7, 1), (7, 4)),
        *((9, 0), (9, 3), (10, 1), (10, 4)),
    ]
    assert true[6, 3] == pytest.approx(4.952, abs=5e-4)  # docs/paper.md


def rank(matrix: Vector) -> int:
    """Rank of a matrix of fractions, by elimination: exact."""
    rows, found = [list(row) for row in matrix], 0
    for column in range(matrix.shape[1]):
        pivot = next((i for i in range(found, len(rows)) if rows[i][column]), None)
        if pivot is None:
            continue
        rows[found], rows[pivot] = rows[pivot], rows[found]
        for i in range(found + 1, len(rows)):
            share = rows[i][column] / rows[found][column]
            rows[i] = [x - share * y for x, y in zip(rows[i], rows[found], strict=True)]
        found += 1
    return found


def test_controllable_in_exact_arithmetic() -> None:
    a, b = printed_matrices()
    blocks, powers = [b], [a]
    for _ in range(STATE_SIZE - 1):
        blocks.append(a.dot(blocks[-1]))
        powers.append(a.dot(powers[-1]))
    assert rank(np.hstack(blocks)) == 18
    assert rank(np.hstack([*powers[:-1], powers[-1].dot(b)])) == 14  # eq. 52 as printed


@pytest.mark.parametrize("vehicle", FLEET.values(), ids=FLEET)
def test_every_mode_can_be_controlled(vehicle: Vehicle) -> None:
    """Popov, Belevitch, Hautus: [A - s·1, B] has full rank for every pole s."""
    model = actuated_model(vehicle)
    size = len(model.A)
    for pole in np.linalg.eigvals(model.A):
        matrix = np.hstack([model.A - pole * np.eye(size), model.B])
        assert np.linalg.svd(matrix, compute_uv=False)[-1] > 1e-6


def test_rotor_lag_is_of_first_order() -> None:
    vehicle = FLEET["large, lag"]
    assert rotor_time_constant(vehicle) == pytest.approx(0.06)
    model = actuated_model(vehicle)
    rigid = linear_model(vehicle)
    # 1 / (1 + tau s) on the way from every input to every state.
    for w in (1e-6, 1.0 / 0.06):
        states = np.linalg.solve(1j * w * np.eye(22) - model.A, model.B)
        without = np.linalg.solve(1j * w * np.eye(18) - rigid.A, rigid.B)
        np.testing.assert_allclose(states[:18] * (1 + 1j * w * 0.06), without, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(with_rotor_lag(rigid, 0.06).A, model.A)
    assert actuated_model(FLEET["paper"]).A.shape == (18, 18)
