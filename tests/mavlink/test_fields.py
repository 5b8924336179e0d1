"""Integer fields of messages, and voltages of a pack over the fields of BATTERY_STATUS."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl_bridge.mavlink.fields import NOT_KNOWN_UINT16, pack_voltage, pack_voltages, whole


def test_whole_numbers() -> None:
    assert whole(1.6, 8) == 2
    assert whole(300.0, 8) == 127
    assert whole(-300.0, 8) == -128
    assert whole(-1.0, 8, signed=False) == 0
    assert whole(math.nan, 8, unknown=-1) == -1
    assert whole(math.inf, 16, signed=False) == 0xFFFF
    assert whole(math.nan, 16) == 0


@given(st.floats(0, 650))
def test_a_pack_of_any_voltage_is_read_as_it_was_told(volts: float) -> None:
    """Also one above 65.5 V, which one field cannot hold."""
    fields = pack_voltages(volts)
    assert len(fields) == 10
    assert all(0 <= field <= 0xFFFF for field in fields)
    assert pack_voltage(fields) == pytest.approx(volts, abs=5.1e-4)


def test_cells_that_nobody_measured_have_no_voltage() -> None:
    assert math.isnan(pack_voltage([NOT_KNOWN_UINT16] * 10))
    assert pack_voltage([3800, 3810, *[NOT_KNOWN_UINT16] * 8]) == pytest.approx(7.61)
