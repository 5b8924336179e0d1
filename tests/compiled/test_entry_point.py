"""What an entry point takes, and what it does with it."""

import struct
from pathlib import Path

import numpy as np
import pytest

from sitl_bridge import compiled
from tests.compiled.sample import loaded


def test_plain_python_and_compiled_give_the_same_numbers(cache: Path) -> None:
    module = loaded()
    for on in (False, True):
        record = np.zeros(1, dtype=module.RECORD)
        record[0] = (1.7, on, [1, -2, 3, 0.5])
        one, other = np.ones(4), np.ones(4)
        bound = module.apply.bind(record, one)
        assert bound(3, 0.3) == 12
        assert module.apply.python(record.view(np.recarray), other, 3, 0.3) == 12
        np.testing.assert_allclose(one, other, rtol=1e-15)
        assert module.apply(record, one, 0, 0.3) == 0
    assert module.ratio(1.0, 0.0) == np.inf  # compiled code does not raise; numpy's rules


def test_arrays_of_two_axes_are_read_row_by_row(cache: Path) -> None:
    table = np.arange(6.0).reshape(2, 3)
    element = loaded().element
    assert [[element(table, row, column) for column in range(3)] for row in range(2)] == table.tolist()


def test_bind_refuses_other_arrays(cache: Path) -> None:
    module = loaded()
    record, out = np.zeros(1, dtype=module.RECORD), np.zeros(4)
    read_only = np.zeros(4)
    read_only.flags.writeable = False
    for bad, words in [
        (np.zeros(4, dtype=np.float32), r"argument 1 is float32\(4,\), expected Buffer"),
        (np.zeros(5), r"float64\(5,\)"),
        (np.zeros((4, 1)), r"float64\(4, 1\)"),
        (np.zeros(8)[::2], "not contiguous"),
        (read_only, "writeable"),
        ([0.0] * 4, "argument 1 is list"),
    ]:
        with pytest.raises(TypeError, match=words):
            module.apply.bind(record, bad)
        with pytest.raises(TypeError, match=words):
            module.apply(record, bad, 1, 1.0)
    with pytest.raises(TypeError, match="1 arrays, expected 2"):
        module.apply.bind(record)
    with pytest.raises(TypeError, match="3 arrays, expected 2"):
        module.apply.bind(record, out, out)
    with pytest.raises(struct.error, match="expected 2 items"):
        module.apply.bind(record, out)(1)
    with pytest.raises(struct.error, match="not an integer"):
        module.apply.bind(record, out)(1.5, 1.0)


def test_bound_arrays_live_as_long_as_what_they_are_bound_to(cache: Path) -> None:
    module = loaded()
    bound = module.apply.bind(np.zeros(1, dtype=module.RECORD), np.zeros(4))
    assert bound(1, 0.5) == 4
    assert bound.keeps[0][1][0] == module.wave(0.0)


def test_an_entry_point_that_is_no_attribute_of_its_module_is_named(cache: Path) -> None:
    module = loaded()
    lost = compiled.entry_point(float, returns=float)(lambda x: x)
    lost.python.__module__ = module.__name__
    lost.name = "lost"
    with pytest.raises(RuntimeError, match="native_sample has no entry point lost"):
        lost(1.0)
