"""What a run finds: numbers under dotted keys, checks of them, verdicts on the paper's claims."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from sitl.json_values import to_json

REPRODUCED = "reproduced"
CORRECTED = "reproduced with a correction"
UNSUPPORTED = "not supported"
UNSETTLED = "unsettled: a number that this verdict rests on is out of tolerance"

WITHIN, OUTSIDE, NOT_JUDGED = "within", "OUTSIDE", "not judged"
"""Verdicts on a number; the last one of a plain result, for which nothing independent exists."""


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

    def put(self, key: str, value: Any, unit: str, why: str) -> Any:
        """Record a plain result (number, text, list, array) under a dotted key; returns it.

        why: for the reader, why there is no expectation beside it.
        """
        return self._check(key, value, None, "none", None, NOT_JUDGED, unit, why)

    def note(self, key: str, value: Any) -> None:
        """Record something about the run itself, which is no finding."""
        self._place(key, value)

    def rows(self, key: str, count: int) -> None:
        """Begin a table: a list of so many rows, whose values are then recorded as `key.0.name` and so on."""
        self._place(key, [{} for _ in range(count)])

    def value(self, key: str) -> Any:
        """What is recorded under a dotted key; a number in it leads into a list."""
        found: Any = self.numbers
        for step in key.split("."):
            found = found[int(step)] if isinstance(found, list) else found[step]
        return found

    def _place(self, key: str, value: Any) -> None:
        *path, name = key.split(".")
        place: Any = self.numbers
        for step in path:
            place = place[int(step)] if isinstance(place, list) else place.setdefault(step, {})
        if name in place:
            raise ValueError(f"{key} is recorded twice")
        place[name] = to_json(value)

    def check(
        self, key: str, value: float, expected: float, tolerance: float, unit: str = "", source: str = ""
    ) -> float:
        """Record a number that should be within `tolerance` of `expected`; source: where that is from."""
        within = math.isfinite(value) and abs(value - expected) <= tolerance
        verdict = _verdict(within)
        return float(
            self._check(key, value, expected, f"± {tolerance:.3g}", tolerance, verdict, unit, source)
        )

    def check_array(
        self, key: str, value: ArrayLike, expected: ArrayLike, tolerance: float, unit: str, source: str
    ) -> None:
        """Record an array, real or complex, with each entry within `tolerance` of the expected one."""
        found, wanted = np.asarray(value), np.asarray(expected)
        within = bool(found.shape == wanted.shape and np.all(np.abs(found - wanted) <= tolerance))
        self._check(key, found, wanted, f"± {tolerance:.3g}", tolerance, _verdict(within), unit, source)

    def check_poles(
        self, key: str, poles: ArrayLike, expected: ArrayLike, tolerance: float, unit: str, source: str
    ) -> None:
        """Record poles, each beside that of the expected ones which belongs to it: no order is expected."""
        found, wanted = np.asarray(poles, dtype=complex), np.asarray(expected, dtype=complex)
        _, order = linear_sum_assignment(np.abs(found[:, None] - wanted))
        self.check_array(key, found, wanted[order], tolerance, unit, source)

    def at_most(self, key: str, value: float, bound: float, unit: str = "", source: str = "") -> float:
        """Record a number that should not exceed a bound; returns it."""
        within = math.isfinite(value) and value <= bound
        return float(self._check(key, value, bound, "at most", None, _verdict(within), unit, source))

    def at_least(self, key: str, value: float, bound: float, unit: str = "", source: str = "") -> float:
        """Record a number that should reach a bound; returns it."""
        verdict = _verdict(value >= bound)
        return float(self._check(key, value, bound, "at least", None, verdict, unit, source))

    def true(self, key: str, value: bool, source: str = "") -> bool:
        """Record something that should be so; returns it."""
        self.same(key, bool(value), True, source)
        return value

    def same(self, key: str, value: Any, expected: Any, source: str) -> None:
        """Record something that should be just what is expected."""
        self._check(key, value, expected, "exactly", None, _verdict(value == expected), "", source)

    def _check(
        self,
        key: str,
        value: Any,
        expected: Any,
        relation: str,
        tolerance: float | None,
        verdict: str,
        unit: str,
        source: str,
    ) -> Any:
        self._place(key, value)
        self.checks[key] = {
            "value": to_json(value),
            "expected": to_json(expected),
            "relation": relation,
            "tolerance": tolerance,
            "verdict": verdict,
            "unit": unit,
            "source": source,
        }
        return value

    def judge(
        self, key: str, where: str, paper: str, ours: str, verdict: str, why: str, rests_on: Sequence[str]
    ) -> None:
        """A verdict on a claim; it stands while the checks that it rests on (keys or prefixes) hold."""
        found = [name for name in self.checks if any(name == k or name.startswith(f"{k}.") for k in rests_on)]
        judged = [name for name in found if self.checks[name]["verdict"] != NOT_JUDGED]
        unknown = [k for k in rests_on if not any(n == k or n.startswith(f"{k}.") for n in judged)]
        if unknown:
            raise ValueError(f"verdict {key} rests on {unknown}, which nothing has checked")
        stands = all(self.checks[name]["verdict"] == WITHIN for name in judged)
        self.verdicts.append(Verdict(key, where, paper, ours, verdict if stands else UNSETTLED, why))

    @property
    def outside(self) -> list[str]:
        """Keys of the checks that failed."""
        return [key for key, check in self.checks.items() if check["verdict"] == OUTSIDE]

    @property
    def judged(self) -> int:
        """How many of the recorded numbers have an expectation."""
        return sum(check["verdict"] != NOT_JUDGED for check in self.checks.values())

    def document(self) -> dict[str, Any]:
        """The content of paper.json."""
        verdicts = {v.key: {k: x for k, x in v._asdict().items() if k != "key"} for v in self.verdicts}
        return {**self.numbers, "checks": self.checks, "verdicts": verdicts}


def _verdict(within: bool) -> str:
    return WITHIN if within else OUTSIDE
