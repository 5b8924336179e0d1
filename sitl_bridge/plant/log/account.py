"""What a plant reports of its run at the end."""

from __future__ import annotations

from typing import TypedDict


class Account(TypedDict):
    """Figures that do not exist are None."""

    completed: bool
    """Whether the scenario came to its end."""
    failure: str | None
    """Why it cannot go on; None: nothing of the kind."""
    stopped_by: str | None
    time_s: float
    """Since the scenario began."""
    real_time_factor: float | None
    """Simulated seconds a second."""
    lateness_us: dict[str, float | None]
    """Of the ticks, by p50, p99 and max; real time only."""
    late_ticks: int
    resent_ticks: int
    unanswered_ticks: int
    state_log: str | None
    tlog: str | None
