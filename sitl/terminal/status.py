"""How a flight goes, as cells of a table or a line of text. Pure functions."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

WIDE = 72
"""Columns from which on the table is one row."""


@dataclass(frozen=True)
class Status:
    """What is shown while a flight lasts; None: not known, or without a meaning now."""

    time_s: float | None = None
    load_m: Sequence[float] | None = None
    """ENU, world."""
    error_m: float | None = None
    """Distance of the load from its reference."""
    tension_N: float | None = None
    mode: str | None = None
    real_time_factor: float | None = None
    condition: str | None = None
    """`crashed`, `upside down`, `load lost`, `ran away`; None: it flies."""


def status_of(event: Mapping[str, Any], error_m: float | None = None) -> Status:
    """The status in a progress event of the plant or the companion."""
    return Status(
        event["time_s"],
        event["load_m"],
        error_m,
        event.get("tension_N"),
        event.get("mode"),
        event.get("real_time_factor"),
        event.get("condition"),
    )


def cells(status: Status) -> list[tuple[str, str]]:
    """Headings and texts of what is known."""
    shown: list[tuple[str, str]] = []
    if status.time_s is not None:
        shown.append(("time", f"{status.time_s:.1f} s"))
    if status.load_m is not None:
        shown.append(("load", " ".join(f"{value:.2f}" for value in status.load_m) + " m"))
    if status.error_m is not None:
        shown.append(("error", f"{status.error_m:.3f} m"))
    if status.tension_N is not None:
        shown.append(("tension", f"{status.tension_N:.1f} N"))
    if doing := status.condition or status.mode:
        shown.append(("mode", doing))
    if status.real_time_factor is not None:
        shown.append(("clock", f"{status.real_time_factor:.2f} x real time"))
    return shown


def plain_text(status: Status, width: int) -> str:
    """One line, or as many as the width takes; every cell stays whole where it fits."""
    texts = [f"{heading} {text}" for heading, text in cells(status)]
    lines: list[str] = []
    for text in texts:
        if lines and len(lines[-1]) + 3 + len(text) <= width:
            lines[-1] += f"   {text}"
        else:
            lines += textwrap.wrap(text, max(width, 1))
    return "\n".join(lines)


def what_happened(before: Status | None, now: Status) -> str | None:
    """A line for a person when the condition changed, else None."""
    known = before.condition if before is not None else None
    if now.condition is None or now.condition == known:
        return None
    at = "" if now.time_s is None else f" at t = {now.time_s:.1f} s"
    return f"{now.condition}{at}"
