"""Values as integer fields of messages, and what stands in a field whose value is not known."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sitl_bridge.frames import MILLIVOLTS_PER_VOLT

NOT_KNOWN_UINT16 = 0xFFFF
NOT_KNOWN_INT16 = 0x7FFF
CELLS, FURTHER_CELLS = 10, 4
"""Elements of BATTERY_STATUS.voltages and .voltages_ext"""


def whole(value: float, bits: int, signed: bool = True, unknown: int | None = None) -> int:
    """An integer field: rounded, kept within the field; what is not finite is `unknown` (or 0)."""
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    if not math.isfinite(value):
        if math.isnan(value) or unknown is not None:
            return unknown or 0
        return high if value > 0 else low
    return max(low, min(high, round(value)))


def pack_voltages(pack: float) -> list[int]:
    """BATTERY_STATUS.voltages, mV, of a pack (V) whose cells are not measured.

    As the message's description says: the whole pack's in the first field, and over as many more as it fills.
    """
    most = NOT_KNOWN_UINT16 - 1
    left = max(0, round(pack * MILLIVOLTS_PER_VOLT))
    fields = [min(most, max(0, left - i * most)) for i in range(CELLS)]
    return [fields[0], *(field or NOT_KNOWN_UINT16 for field in fields[1:])]


def pack_voltage(voltages: Sequence[int]) -> float:
    """V, of the fields BATTERY_STATUS.voltages, be they cells or a whole pack's; NaN if none is known."""
    known = [field for field in voltages if field != NOT_KNOWN_UINT16]
    return sum(known) / MILLIVOLTS_PER_VOLT if known else math.nan
