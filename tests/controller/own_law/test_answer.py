"""What a law may return, and what is said of anything else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from controller.own_law import answer
from controller.own_law.interface import Wrench


@pytest.mark.parametrize(
    "returned",
    [(9.0, [1.0, 2.0, 3.0]), (np.float64(9.0), np.array([1, 2, 3])), Wrench(9.0, (1.0, 2.0, 3.0))],
)
def test_thrust_and_moments(returned: Any) -> None:
    commands = answer.read(returned, 4)
    assert isinstance(commands, answer.Commands)
    assert commands.rotors is None
    np.testing.assert_array_equal(commands.wrench, [9.0, 1.0, 2.0, 3.0])


def test_rotor_commands() -> None:
    commands = answer.read([0.0, 0.5, 0.5, 1.0], 4)
    assert isinstance(commands, answer.Commands)
    assert commands.wrench is None
    np.testing.assert_array_equal(commands.rotors, [0.0, 0.5, 0.5, 1.0])


@pytest.mark.parametrize(
    ("returned", "says"),
    [
        (None, "None"),
        (3.0, "shape ()"),
        ("up", "'up'"),
        ((9.0, [1.0, 2.0]), "shapes () and (2,)"),
        ((9.0, [1.0, np.nan, 0.0]), "not finite"),
        ((None, [1.0, 0.0, 0.0]), "not finite"),
        ([196.2, 0.0, 0.0, 0.0], "196.2"),
        ([0.5, 0.5, np.nan, 0.5], "nan"),
        (np.zeros((4, 1)), "shape (4, 1)"),
        (np.zeros(6), "shape (6,)"),
        ({"thrust": 3.0}, "thrust"),
        ((1.0, object()), "object"),
        (1j, "1j"),
    ],
)
def test_anything_else_is_one_line(returned: Any, says: str) -> None:
    fault = answer.read(returned, 4)
    assert isinstance(fault, str)
    assert says in fault
    assert "expected (thrust, moments)" in fault
    assert "\n" not in fault
