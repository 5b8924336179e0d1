"""`sitl sweep`: flies what is missing of a study on Dask's workers, then judges it and writes its page."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from sitl.studies.sweep.cluster import as_they_come, cluster
from sitl.studies.sweep.dataset import IDENTITY, read_rows, write_rows
from sitl.studies.sweep.draws import Draw, draws
from sitl.studies.sweep.page import write_page
from sitl.studies.sweep.study import Study, load_study
from sitl.studies.sweep.verdicts import Judged, judge
from sitl.studies.sweep.worker import fly_draw
from sitl_bridge.process import StopRequest

BATCH = 16
"""Flights that a worker is given at once."""
WRITE_INTERVAL = 5.0
"""s between two files of rows."""
SHOW_INTERVAL = 1.0


@dataclass(frozen=True)
class SweepOptions:
    """What `sitl sweep` is asked for."""

    file: Path
    out: Path
    workers: int | None = None
    """Processes of the local cluster; None: one for each core."""
    scheduler: str | None = None
    """Address of a Dask scheduler; None: a local cluster."""


@dataclass(frozen=True)
class Swept:
    """What a study came to."""

    rows: list[dict[str, Any]]
    verdicts: list[Judged]
    page: Path
    missing: int
    """Flights that have not been flown, because it was stopped."""

    @property
    def holds(self) -> bool:
        """Whether all was flown and every verdict holds."""
        return not self.missing and all(judged.holds for judged in self.verdicts)


def sweep(options: SweepOptions, stop: StopRequest) -> Swept:
    """Fly what is missing, judge, write the page. Raises DescriptionError, OSError."""
    study = load_study(options.file)
    wanted = draws(study)
    options.out.mkdir(parents=True, exist_ok=True)
    known = {row[IDENTITY]: row for row in read_rows(options.out)}
    missing = [draw for draw in wanted if draw.identity not in known]
    _say(f"{study.name}: {len(wanted)} flights, {len(wanted) - len(missing)} flown already")
    if missing:
        known |= _fly(study, missing, options, stop)
    rows = [known[draw.identity] for draw in wanted if draw.identity in known]
    verdicts = judge(study.verdict, rows)
    page = write_page(options.out, study, options.file, rows, verdicts)
    return Swept(rows, verdicts, page, len(wanted) - len(rows))


def _fly(
    study: Study, missing: Sequence[Draw], options: SweepOptions, stop: StopRequest
) -> dict[str, dict[str, Any]]:
    """Rows by identity; each is on disk within seconds."""
    known: dict[str, dict[str, Any]] = {}
    unwritten: list[dict[str, Any]] = []
    with cluster(options.workers, options.scheduler) as client:
        progress = _Progress(len(missing))
        written_at = time.monotonic()
        arguments = study.model_dump(mode="json"), str(options.out)
        batches = batches_of(missing)
        coming = as_they_come(client, fly_batch, batches, *arguments, stop=stop, lost=lost_row)
        try:
            for rows in coming:
                known |= {row[IDENTITY]: row for row in rows}
                unwritten += rows
                progress.show(len(known))
                if time.monotonic() - written_at > WRITE_INTERVAL:
                    write_rows(options.out, unwritten)
                    unwritten, written_at = [], time.monotonic()
        finally:
            write_rows(options.out, unwritten)
            coming.close()
        progress.end()
        if stop:
            _say(f"stopped by {stop.reason}; the same command goes on from here")
    return known


def batches_of(missing: Sequence[Draw]) -> list[list[dict[str, Any]]]:
    """Draws in batches for the workers, small enough that all are busy to the end."""
    size = max(1, min(BATCH, len(missing) // 8))
    return [[draw._asdict() for draw in missing[k : k + size]] for k in range(0, len(missing), size)]


def fly_batch(batch: list[dict[str, Any]], study: dict[str, Any], out: str) -> list[dict[str, Any]]:
    """Rows of some draws; runs in a worker."""
    rows = []
    for draw in batch:
        logs = None if study["logs"] == "none" else str(Path(out) / "logs" / draw["identity"])
        rows.append(_row(draw, fly_draw(study, draw["inputs"], logs)))
    return rows


def lost_row(draw: dict[str, Any]) -> dict[str, Any]:
    """The row of a flight that no worker came back from."""
    return _row(draw, {"outcome": "raised", "outcome_cause": "its worker was killed, again and again"})


def _row(draw: dict[str, Any], flown: dict[str, Any]) -> dict[str, Any]:
    return {IDENTITY: draw["identity"], **draw["inputs"], **flown, "versions": _versions()}


@cache
def _versions() -> str:
    return " ".join(f"{name} {metadata.version(name)}" for name in ("sitl-bridge", "numpy"))


class _Progress:
    """Flights a second and the time that is left, on standard error."""

    def __init__(self, total: int) -> None:
        self._total = total
        self._began = time.monotonic()
        self._next = 0.0
        self._rewrites = sys.stderr.isatty()

    def show(self, done: int) -> None:
        """So many are over."""
        now = time.monotonic()
        if now < self._next and done < self._total:
            return
        self._next = now + (SHOW_INTERVAL if self._rewrites else 10.0)
        rate = done / max(1e-6, now - self._began)
        left = (self._total - done) / max(1e-9, rate)
        text = f"{done} of {self._total} flights, {60 * rate:.0f} a minute, {left:.0f} s left"
        print(
            f"\r\x1b[K{text}" if self._rewrites else text, end="" if self._rewrites else "\n", file=sys.stderr
        )
        sys.stderr.flush()

    def end(self) -> None:
        """The line is over."""
        if self._rewrites:
            print(file=sys.stderr)


def _say(text: str) -> None:
    print(f"sweep: {text}", file=sys.stderr, flush=True)
