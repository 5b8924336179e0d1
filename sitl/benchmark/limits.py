"""`sitl bench --check`: each figure that has a limit against it. Pure functions."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

Verdict = Literal["met", "within spread", "missed", "not measured"]


class Limit(NamedTuple):
    """What a figure is to be."""

    key: str
    value: float
    at_least: bool = False
    """Otherwise it is at most that."""


LIMITS = (
    Limit("lockstep_tick_per_round_trip", 1.4),
    Limit("lockstep_tick_estimate_per_round_trip", 2.2),
    Limit("estimator_update_us", 15.0),
    Limit("physics_step_full_ratio", 1.3),
    Limit("lossy_real_time_factor", 15.0, at_least=True),
    Limit("launch_to_first_command_s", 0.6),
    Limit("hold_tick_ratio", 1.3),
    Limit("memory_mb_plant", 90.0),
    Limit("memory_mb_controller", 90.0),
    Limit("logs_mb_per_min", 5.0),
    Limit("logs_mb_per_min_estimate", 5.0),
    Limit("in_process_real_time_factor", 250.0, at_least=True),
    Limit("in_process_real_time_factor_estimate", 80.0, at_least=True),
    Limit("sweep_two_workers_ratio", 1.8, at_least=True),
)


class Checked(NamedTuple):
    """A figure against its limit."""

    limit: Limit
    median: float
    spread: float
    verdict: Verdict

    def to_json(self) -> dict[str, float | str | None]:
        """For JSON."""
        bound = "at_least" if self.limit.at_least else "at_most"
        measured = self.verdict != "not measured"
        return {
            "median": self.median if measured else None,
            "spread": self.spread if measured else None,
            bound: self.limit.value,
            "verdict": self.verdict,
        }


def spread_of(samples: Sequence[float]) -> float:
    """Half the range that the middle half of the samples takes: 0 of a single one."""
    if len(samples) < 2:
        return 0.0
    low, _, high = statistics.quantiles(samples, n=4, method="inclusive")
    return 0.5 * (high - low)


def check(limit: Limit, samples: Sequence[float]) -> Checked:
    """Whether the median keeps a limit; where it does not, whether it misses it by more than the spread."""
    if not samples:
        return Checked(limit, float("nan"), 0.0, "not measured")
    median, spread = statistics.median(samples), spread_of(samples)
    excess = limit.value - median if limit.at_least else median - limit.value
    verdict: Verdict = "met" if excess <= 0.0 else "within spread" if excess <= spread else "missed"
    return Checked(limit, median, spread, verdict)


def check_all(samples: Mapping[str, Sequence[float]]) -> list[Checked]:
    """Every limit."""
    return [check(limit, samples.get(limit.key, ())) for limit in LIMITS]


def check_table(checked: Sequence[Checked]) -> str:
    """For people."""
    lines = [f"  {'':<40}{'median':>10}{'spread':>10}   limit"]
    for row in checked:
        sign = "≥" if row.limit.at_least else "≤"
        limit = f"{sign} {row.limit.value:g}"
        lines.append(f"  {row.limit.key:<40}{row.median:>10.3f}{row.spread:>10.3f}   {limit:<8}{row.verdict}")
    return "\n".join(lines)
