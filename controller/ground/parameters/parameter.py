"""One parameter as the table describes it."""

from __future__ import annotations

import math
from typing import NamedTuple


class Parameter(NamedTuple):
    """One parameter. It is an integer (INT32) if its default is an `int`, else REAL32."""

    name: str
    default: float
    minimum: float
    maximum: float
    unit: str
    description: str
    choices: tuple[tuple[int, str], ...] = ()
    """Allowed values with their meanings, where only some are allowed."""
    used: bool = True
    """False: it is one of PX4's that has nothing to act on here, and is only kept."""

    @property
    def is_integer(self) -> bool:
        """Whether it is INT32 on the wire."""
        return isinstance(self.default, int)

    def shown(self, value: float) -> str:
        """A value for a person; an integer in all its digits."""
        whole = self.is_integer and math.isfinite(value) and value == int(value)
        return str(int(value)) if whole else f"{value:g}"

    @property
    def range(self) -> str:
        """What it may be."""
        if self.choices:
            return ", ".join(f"{number} {word}" for number, word in self.choices)
        return f"{self.shown(self.minimum)} to {self.shown(self.maximum)}"
