"""How long a vehicle for other people's tests is waited for."""

from pathlib import Path
from typing import Any

import pytest

from sitl import testing


class SlowStart:
    """A vehicle that says a line every `interval` s of a clock that only its waiter's sleep moves."""

    def __init__(self, log: Path, interval: float, lines: list[str]) -> None:
        self._log, self._interval, self._lines = log, interval, lines
        self.now = 0.0
        self._said_at = 0.0
        log.touch()

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        if self._lines and self.now >= self._said_at + self._interval:
            self._said_at = self.now
            with self._log.open("a") as log:
                print(self._lines.pop(0), file=log)

    def poll(self) -> None:
        return None


def waited(monkeypatch: pytest.MonkeyPatch, start: SlowStart, log: Path) -> float:
    monkeypatch.setattr(testing, "time", start)
    process: Any = start
    testing._wait_for(process, log, "plant connected")
    return start.now


def test_a_start_that_compiles_for_long_is_waited_for(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    lines = [f"compiling {part} of 9: part" for part in range(1, 10)] + ["controller: plant connected"]
    almost = testing.START_PATIENCE - 1.0
    assert waited(monkeypatch, SlowStart(log, almost, lines), log) > 9 * almost


def test_a_start_that_says_nothing_more_is_given_up(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    log = tmp_path / "log"
    start = SlowStart(log, 1.0, ["compiling 1 of 9: part"])
    with pytest.raises(RuntimeError, match=r"did not start:\ncompiling 1 of 9: part"):
        waited(monkeypatch, start, log)
    assert start.now == pytest.approx(testing.START_PATIENCE, abs=2.0)
