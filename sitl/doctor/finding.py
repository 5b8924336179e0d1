"""One finding, and the line that shows it."""

from __future__ import annotations

from typing import Literal, NamedTuple


class Finding(NamedTuple):
    """What one check found."""

    level: Literal["ok", "note", "fail"]
    """`fail`: it prevents a flight; `note`: a flight works, something else does not or not well."""
    check: str
    found: str
    advice: str = ""
    """What to do; empty if there is nothing to do."""

    def line(self) -> str:
        """The finding as one line of text."""
        text = f"{self.level:<5}{self.check:<10}{self.found}"
        return f"{text}: {self.advice}" if self.advice else text
