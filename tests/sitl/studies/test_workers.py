"""Studies whose workers are killed, and that are stopped: no row is lost, and none is flown twice."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from distributed import Client, LocalCluster

from sitl.studies.sweep.cluster import as_they_come
from sitl.studies.sweep.dataset import IDENTITY, read_rows
from sitl.studies.sweep.run import SweepOptions, Swept, sweep
from sitl_bridge.process import StopRequest

PATIENCE = 120.0
"""s; only a broken program takes so long."""
STUDY = 'name = "Mine"\nscenario = "hover"\nduration = 1.0\nseeds = {seeds}\n'


@pytest.fixture(scope="module")
def workers() -> Iterator[LocalCluster]:
    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", host="127.0.0.1", silence_logs=50
    ) as cluster:
        yield cluster


def until(holds: Callable[[], Any]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def seeds_of(rows: list[dict[str, Any]]) -> list[int]:
    return sorted(int(row["seed"]) for row in rows)


def test_a_worker_that_is_killed_loses_nothing(workers: LocalCluster, tmp_path: Path) -> None:
    file, out = tmp_path / "mine.toml", tmp_path / "out"
    file.write_text(STUDY.format(seeds=40))
    swept: list[Swept] = []
    options = SweepOptions(file, out, scheduler=workers.scheduler_address)
    flying = threading.Thread(target=lambda: swept.append(sweep(options, StopRequest())))
    flying.start()
    victim = workers.workers[0]
    killed = victim.pid
    with Client(workers) as client:
        until(lambda: client.processing().get(victim.worker_address))
        os.kill(killed, signal.SIGKILL)
        until(lambda: victim.pid not in (None, killed))
    flying.join(PATIENCE)
    assert swept[0].missing == 0
    assert seeds_of(read_rows(out)) == list(range(40))
    assert {row["outcome"] for row in swept[0].rows} <= {"settled", "did not settle"}


def ends_its_worker(batch: list[int]) -> list[int]:
    if 3 in batch:
        os._exit(1)
    return [10 * number for number in batch]


def test_what_kills_its_workers_takes_nothing_with_it(
    workers: LocalCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers.scheduler, "allowed_failures", 0)
    with Client(workers) as client:
        coming = as_they_come(client, ends_its_worker, [[1, 2, 3], [4]], lost=lambda number: -number)
        assert sorted(found for batch in coming for found in batch) == [-3, 10, 20, 40]


def test_a_study_that_is_interrupted_goes_on_where_it_was(workers: LocalCluster, tmp_path: Path) -> None:
    file, out = tmp_path / "mine.toml", tmp_path / "out"
    file.write_text(STUDY.format(seeds=1000))
    command = [sys.executable, "-m", "sitl", "sweep", str(file), "--out", str(out)]
    command += ["--scheduler", workers.scheduler_address]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        line = next(line for line in process.stderr if "of 1000 flights" in line)
        process.send_signal(signal.SIGINT)
        said = process.stderr.read()
        assert process.wait(PATIENCE) == 130, said
    assert "stopped by SIGINT" in said
    rows = read_rows(out)
    assert int(line.split()[0]) <= len(rows) < 1000
    seeds = seeds_of(rows)
    file.write_text(STUDY.format(seeds=seeds[-1] + 5))
    swept = sweep(SweepOptions(file, out, scheduler=workers.scheduler_address), StopRequest())
    assert swept.missing == 0
    assert seeds_of(swept.rows) == list(range(seeds[-1] + 5))
    assert len({row[IDENTITY] for row in read_rows(out)}) == len(read_rows(out))
