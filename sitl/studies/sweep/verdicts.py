"""Whether a study's limits hold over its rows. Pure functions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from sitl.studies.sweep.study import Verdict


class Judged(NamedTuple):
    """One verdict and what came out."""

    text: str
    holds: bool
    found: str


def judge(verdicts: Sequence[Verdict], rows: Sequence[dict[str, Any]]) -> list[Judged]:
    """Each verdict over all rows."""
    return [
        _on_outcomes(verdict, rows) if verdict.outcome else _on_figure(verdict, rows) for verdict in verdicts
    ]


def _limits(verdict: Verdict) -> str:
    parts = []
    if verdict.at_least is not None:
        parts.append(f"at least {verdict.at_least:g}")
    if verdict.at_most is not None:
        parts.append(f"at most {verdict.at_most:g}")
    return " and ".join(parts)


def _within(verdict: Verdict, value: float) -> bool:
    low = -math.inf if verdict.at_least is None else verdict.at_least
    high = math.inf if verdict.at_most is None else verdict.at_most
    return low <= value <= high


def _on_outcomes(verdict: Verdict, rows: Sequence[dict[str, Any]]) -> Judged:
    assert verdict.outcome is not None
    count = sum(row.get("outcome") in verdict.outcome for row in rows)
    text = f"{_limits(verdict)} of {len(rows)} flights: {', '.join(verdict.outcome)}"
    return Judged(text, _within(verdict, count), f"{count}")


def _on_figure(verdict: Verdict, rows: Sequence[dict[str, Any]]) -> Judged:
    assert verdict.figure is not None
    values = [float(row[verdict.figure]) for row in rows if row.get(verdict.figure) is not None]
    inside = sum(_within(verdict, value) for value in values)
    share = inside / len(values) if values else 0.0
    of_them = "" if verdict.share == 1.0 else f" in {100 * verdict.share:g} % of the flights"
    text = f"{verdict.figure} {_limits(verdict)}{of_them}"
    if not values:
        return Judged(text, False, "no flight has it")
    found = f"{min(values):.4g} to {max(values):.4g}, {100 * share:.4g} % within"
    return Judged(text, share >= verdict.share, found)
