"""PX4's flight modes by number, and which of them this vehicle has."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

_MAIN_POSITION, _MAIN_AUTO = 3, 4
_WITH_SUB_MODES = (_MAIN_POSITION, _MAIN_AUTO)
_PROPERTY_ADVANCED = 1
_PROPERTY_NOT_USER_SELECTABLE = 2


class _Numbers(NamedTuple):
    main: int
    sub: int
    standard: int
    """MAV_STANDARD_MODE"""
    properties: int
    """MAV_MODE_PROPERTY"""


class Mode(Enum):
    """Flight modes, with PX4's main and sub mode, the standard mode and its properties."""

    TAKEOFF = _Numbers(_MAIN_AUTO, 2, 8, 0)
    HOLD = _Numbers(_MAIN_AUTO, 3, 0, 0)
    MISSION = _Numbers(_MAIN_AUTO, 4, 6, 0)
    RTL = _Numbers(_MAIN_AUTO, 5, 5, 0)
    LAND = _Numbers(_MAIN_AUTO, 6, 7, 0)
    FOLLOW_TARGET = _Numbers(_MAIN_AUTO, 8, 0, 0)
    POSITION = _Numbers(_MAIN_POSITION, 0, 1, 0)
    ALTITUDE = _Numbers(2, 0, 4, 0)
    ORBIT = _Numbers(_MAIN_POSITION, 1, 2, 0)
    OFFBOARD = _Numbers(6, 0, 0, _PROPERTY_ADVANCED)
    TERMINATION = _Numbers(10, 0, 0, _PROPERTY_NOT_USER_SELECTABLE)

    @property
    def custom_mode(self) -> int:
        """HEARTBEAT.custom_mode."""
        return self.value.main << 16 | self.value.sub << 24

    @property
    def standard_mode(self) -> int:
        """MAV_STANDARD_MODE, 0 where there is none."""
        return int(self.value.standard)

    @property
    def properties(self) -> int:
        """MAV_MODE_PROPERTY bits."""
        return int(self.value.properties)

    @property
    def title(self) -> str:
        """The mode's name for a person."""
        return {"RTL": "Return", "FOLLOW_TARGET": "Follow Me"}.get(self.name, self.name.capitalize())


BY_STICKS = (Mode.POSITION, Mode.ALTITUDE)
SELECTABLE = tuple(mode for mode in Mode if mode is not Mode.TERMINATION)
_BY_NUMBER = {(mode.value.main, mode.value.sub): mode for mode in SELECTABLE}
# What else PX4 has: AUTO without a sub-mode, a landing on a beacon that is not there, slow sticks.
_BY_NUMBER |= {(4, 0): Mode.MISSION, (4, 9): Mode.LAND, (3, 2): Mode.POSITION}
_BY_STANDARD = {mode.standard_mode: mode for mode in SELECTABLE if mode.standard_mode}
_ELSEWHERE = {
    1: "Manual",
    5: "Acro",
    7: "Stabilized",
    8: "Rattitude",
    9: "Simple",
}
_FITTING = "use Position, Altitude, Hold, Mission, Offboard, Return or Land"


def find_mode(main: float, sub: float) -> Mode | str:
    """The mode of PX4's numbers, or why there is none."""
    if main != int(main) or sub != int(sub):
        return f"Mode {main:g}/{sub:g} does not exist; {_FITTING}"
    found = _BY_NUMBER.get((int(main), int(sub) if main in _WITH_SUB_MODES else 0))
    if found is not None:
        return found
    if int(main) in _ELSEWHERE:
        return f"{_ELSEWHERE[int(main)]} mode has no position control, which the load needs; {_FITTING}"
    if int(main) == Mode.TERMINATION.value.main:
        return "Termination is entered by MAV_CMD_DO_FLIGHTTERMINATION only"
    return f"Mode {int(main)}/{int(sub)} does not exist; {_FITTING}"


def find_standard_mode(number: float) -> Mode | str:
    """The mode of a MAV_STANDARD_MODE, or why there is none."""
    return _BY_STANDARD.get(int(number)) or f"Standard mode {number:g} does not exist here; {_FITTING}"
