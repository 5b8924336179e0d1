"""What every section of the page works with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sitl.studies.paper.flights import Pilot
from sitl.studies.paper.record import Ledger


@dataclass(frozen=True)
class Context:
    """One run of `sitl paper`."""

    ledger: Ledger
    pilot: Pilot
    quick: bool
    say: Callable[[str], None]
    """Shows progress."""
