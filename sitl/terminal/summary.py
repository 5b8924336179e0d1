"""The table at the end of a flight, as wide as the terminal. Pure functions."""

from __future__ import annotations

import textwrap
from typing import Any

from sitl.report.metrics import HOLDING_DISTANCE
from sitl.report.outcome import FELL

NARROW = 60
"""Columns below which the table gives each value a line of its own."""
_LABEL_WIDTH = 26


def table(summary: dict[str, Any], width: int = 1000) -> str:
    """The few lines at the end of a flight; width: of the terminal, in columns.

    Figures of the motion are left out unless the flight was complete: they mean nothing then.
    """
    rows = [
        ("outcome", _outcome(summary)),
        *(_motion(summary) if is_complete(summary) else _until(summary)),
        ("own law, a tick", _cost(summary.get("law") or {})),
        ("real-time factor", _with_unit(summary.get("real_time_factor"), "", 2)),
        ("lateness p50 / p99 / max", _lateness(summary.get("lateness_us") or {})),
        ("late ticks", _with_unit(summary.get("late_ticks"), "", 0)),
        ("resent ticks", _with_unit(summary.get("resent_ticks"), "", 0)),
    ]
    return "\n".join(row(name, value, width) for name, value in rows if value)


def is_complete(summary: dict[str, Any]) -> bool:
    """Whether a flight went to its end, with a vehicle that still flew."""
    return not summary.get("failure") and summary.get("outcome") not in (*FELL, "interrupted", "failed")


def _motion(summary: dict[str, Any]) -> list[tuple[str, str]]:
    return [
        ("points", _points(summary.get("points") or [])),
        ("2 % settling time", _with_unit(summary.get("settling_time_2pct_s"), "s", 2)),
        ("1 cm settling time", _with_unit(summary.get("settling_time_1cm_s"), "s", 2)),
        ("overshoot", _with_unit(summary.get("overshoot_pct"), "%", 1)),
        ("steady-state error", _with_unit(_scaled(summary.get("steady_state_error_m"), 1e3), "mm", 3)),
        ("tracking rms", _with_unit(_scaled(summary.get("tracking_rms_m"), 1e3), "mm", 3)),
    ]


def _until(summary: dict[str, Any]) -> list[tuple[str, str]]:
    return [("flown", _with_unit(summary.get("time_s"), "s", 2))]


def row(name: str, value: str, width: int) -> str:
    """A row of a table, no wider than the terminal."""
    if width >= NARROW:
        first, rest = f"  {name:<{_LABEL_WIDTH}}", " " * (_LABEL_WIDTH + 2)
    else:
        first, rest = f"  {name}: ", " " * 4
    return textwrap.fill(value, max(width, 20), initial_indent=first, subsequent_indent=rest)


def _outcome(summary: dict[str, Any]) -> str:
    """How it ended, when and why: GPS noise alone can be more than 2 % of a step."""
    if summary["settled"]:
        allowed = summary.get("settled_tolerance_m") or 0.0
        missed = summary.get("settling_time_2pct_s") is None
        as_near = missed and allowed > HOLDING_DISTANCE
        return f"settled within {allowed:.2f} m, as near as its sensors tell" if as_near else "settled"
    outcome = summary.get("outcome")
    text = IN_WORDS.get(str(outcome), str(outcome or "did not settle").upper())
    if outcome in FELL and summary.get("outcome_time_s") is not None:
        text += f" at t = {summary['outcome_time_s']:.2f} s"
    cause = summary.get("outcome_cause")
    return f"{text}: {cause}" if cause else text


IN_WORDS = {"turned over": "UPSIDE DOWN", "hit the ground": "CRASHED"}


def _points(points: list[dict[str, Any]]) -> str:
    """Of a sequence: from when on its figures count, and the worst of all overshoots."""
    if not points:
        return ""
    worst = max(point["overshoot_pct"] or 0.0 for point in points)
    began = [point["set_at_s"] for point in points if point["set_at_s"] is not None]
    counted = f"figures below count from {began[-1]:.2f} s on"
    return f"{len(began)} of {len(points)} set, overshoot up to {worst:.1f} %; {counted}"


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


def _with_unit(value: float | None, unit: str, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f} {unit}".rstrip()


def _cost(law: dict[str, Any]) -> str:
    if law.get("mean_us") is None:
        return ""
    return f"{law['mean_us']:.1f} us mean, {law['worst_us']:.0f} us worst"


def _lateness(lateness: dict[str, float | None]) -> str:
    if lateness.get("p50") is None:
        return ""
    return " / ".join(f"{lateness[key]:.0f}" for key in ("p50", "p99", "max")) + " us"
