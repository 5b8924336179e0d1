"""The histogram of lateness, against percentiles of the whole list."""

import numpy as np
import pytest

from sitl_bridge.plant.clocks.lateness import Lateness


def test_percentiles_as_of_a_list() -> None:
    late = np.random.default_rng(1).lognormal(np.log(60e-6), 1.5, 20_000)
    lateness = Lateness()
    for each in late.tolist():
        lateness.add(each)
    assert lateness.ticks == len(late)
    assert lateness.largest == late.max()
    for percent in (1, 50, 99, 99.9):
        assert lateness.percentile(percent) == pytest.approx(np.percentile(late, percent), rel=0.01)


def test_a_percentile_is_right_to_a_quarter_of_a_percent() -> None:
    for late in np.geomspace(2e-7, 900.0, 50).tolist():
        lateness = Lateness()
        lateness.add(late)
        lateness.add(1e3)
        assert lateness.percentile(50) == pytest.approx(late, rel=0.0026)


def test_no_ticks_punctual_ones_and_hours() -> None:
    lateness = Lateness()
    assert lateness.percentile(50) is None
    lateness.add(0.0)
    assert lateness.percentile(50) == 0.0
    for _ in range(3):
        lateness.add(7200.0)
    assert lateness.largest == 7200.0
    assert lateness.percentile(25) == pytest.approx(1e-7, rel=0.01)
    assert lateness.percentile(99) == pytest.approx(1e3, rel=0.01)


def test_its_size_does_not_grow() -> None:
    lateness = Lateness()
    bins = len(lateness._counts)
    for tick in range(1000):
        lateness.add(1e-9 * 1.1**tick)
    assert len(lateness._counts) == bins
