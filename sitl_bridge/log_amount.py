"""How much a flight leaves behind: what `--logs` says."""

from __future__ import annotations

from typing import Literal

Logs = Literal["none", "usual", "all"]
"""None; little enough to keep every flight; everything that was said and estimated."""
LOGS: tuple[Logs, ...] = ("none", "usual", "all")
