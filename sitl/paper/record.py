"""What a run finds: numbers under dotted keys, checks of them, verdicts on the paper's claims."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from sitl.plain import plain

REPRODUCED = "reproduced"
CORRECTED = "reproduced with a correction"
UNSUPPORTED = "not supported"
UNSETTLED = "unsettled: a number that this verdict rests on is out of tolerance"


class Verdict(NamedTuple):
    """What the paper shows, what we get, and how the two compare."""

    key: str
    where: str
    """Figure, equation or section of the paper."""
    paper: str
    ours: str
    verdict: str
    why: str
    """The correction, or the reason."""


class Ledger:
    """Everything that goes into paper.json. `numbers` nests by key: `put("figures.3.frequency_hz", 0.7)`."""

    def __init__(self) -> None:
        self.numbers: dict[str, Any] = {}
        self.checks: dict[str, dict[str, Any]] = {}
        self.verdicts: list[Verdict] = []

    def put(self, key: str, value: Any) -> Any:
        """Record a value (number, text, list, array) under a dotted key; returns it."""
        *path, name = key.split(".")
        place = self.numbers
        for step in path:
            place = place.setdefault(step, {})
        if name in place:
            raise ValueError(f"{key} is recorded twice")
        place[name] = plain(value)
        return value

    def check(
        self, key: str, value: float, expected: float, tolerance: float, unit: str = "", source: str = ""
    ) -> float:
        """Record a number that should be within `tolerance` of `expected`; source: where that is from."""
        within = math.isfinite(value) and abs(value - expected) <= tolerance
        return float(self._check(key, value, expected, f"± {tolerance:.3g}", tolerance, within, unit, source))

    def at_most(self, key: str, value: float, bound: float, unit: str = "", source: str = "") -> float:
        """Record a number that should not exceed a bound; returns it."""
        within = math.isfinite(value) and value <= bound
        return float(self._check(key, value, bound, "at most", None, within, unit, source))

    def at_least(self, key: str, value: float, bound: float, unit: str = "", source: str = "") -> float:
        """Record a number that should reach a bound; returns it."""
        return float(self._check(key, value, bound, "at least", None, value >= bound, unit, source))

    def true(self, key: str, value: bool, source: str = "") -> bool:
        """Record something that should be so; returns it."""
        self._check(key, bool(value), True, "exactly", None, bool(value), "", source)
        return value

    def _check(
        self,
        key: str,
        value: Any,
        expected: Any,
        relation: str,
        tolerance: float | None,
        within: bool,
        unit: str,
        source: str,
    ) -> Any:
        self.put(key, value)
        self.checks[key] = {
            "value": plain(value),
            "expected": plain(expected),
            "relation": relation,
            "tolerance": tolerance,
            "verdict": "within" if within else "OUTSIDE",
            "unit": unit,
            "source": source,
        }
        return value

    def judge(
        self, key: str, where: str, paper: str, ours: str, verdict: str, why: str, rests_on: Sequence[str]
    ) -> None:
        """A verdict on a claim; it stands while the checks that it rests on (keys or prefixes) hold."""
        found = [name for name in self.checks if any(name == k or name.startswith(f"{k}.") for k in rests_on)]
        unknown = [k for k in rests_on if not any(n == k or n.startswith(f"{k}.") for n in self.checks)]
        if unknown:
            raise ValueError(f"verdict {key} rests on {unknown}, which nothing has checked")
        stands = all(self.checks[name]["verdict"] == "within" for name in found)
        self.verdicts.append(Verdict(key, where, paper, ours, verdict if stands else UNSETTLED, why))

    @property
    def outside(self) -> list[str]:
        """Keys of the checks that failed."""
        return [key for key, check in self.checks.items() if check["verdict"] != "within"]

    def document(self) -> dict[str, Any]:
        """The content of paper.json."""
        verdicts = {v.key: {k: x for k, x in v._asdict().items() if k != "key"} for v in self.verdicts}
        return {**self.numbers, "checks": self.checks, "verdicts": verdicts}
