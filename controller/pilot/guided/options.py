"""What ground control is started with; light, since every controller's command line names it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple


class Ports(NamedTuple):
    """UDP ports of one link."""

    local: int
    peer: int
    """On this machine, whom the link speaks to first."""


@dataclass(frozen=True)
class GroundOptions:
    """How ground control reaches a vehicle. Ports that are None are PX4's."""

    stations: Ports | None = None
    onboard: Ports | None = None
    signing_key: Path | None = None
    parameters: Path | None = None
    exposed: bool = False
    logs: Path | None = None
    """The folder of the flight's logs, which clients may read"""
