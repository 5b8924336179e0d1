"""Flies for hours, and shows whether memory, tick, lateness and logs stay as they are.

    python scripts/long_flight.py --hours 24                       # lockstep, as fast as it goes
    python scripts/long_flight.py --hours 1 --clock realtime
    python scripts/long_flight.py --hours 2 --logs usual --table runs/long.csv

`iris` hovers on its estimate; plant and controller are two processes. A row of the table is a stretch of the
flight: simulated hours at its end, memory of both processes (MB resident), CPU time of both for each tick and
wall time of a tick (us), and MB of logs. The last lines compare the last quarter of the flight with the
second: the first has start-up in it. The exit code is 1 if memory has grown by more than --most-growth.
CPU time judges the tick on a busy machine, which stretches wall time.
"""

from __future__ import annotations

import argparse
import csv
import os
import re
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
from sitl.flights.free_ports import free_ports  # noqa: E402
from sitl.flights.launch import Pair, watch  # noqa: E402
from sitl_bridge.log_amount import LOGS  # noqa: E402
from sitl_bridge.process import StopRequest  # noqa: E402

RATE_HZ = 250.0
NAMES = ("plant", "controller")
STRETCHES = 40
"""Rows of the table."""


class Row(NamedTuple):
    """One stretch of a flight."""

    simulated_h: float
    plant_mb: float
    controller_mb: float
    plant_cpu_us: float
    controller_cpu_us: float
    tick_us: float
    logs_mb: float


def resident_mb(process: int) -> float:
    """Memory of a process that is in use now, MB (Linux)."""
    found = re.search(r"^VmRSS:\s+(\d+) kB", Path(f"/proc/{process}/status").read_text(), re.MULTILINE)
    return int(found[1]) * 1024 / 1e6 if found else float("nan")


def cpu_s(process: int) -> float:
    """CPU time of a process so far, s (Linux)."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def files_mb(folder: Path, processes: list[int]) -> float:
    """MB in a folder, with what processes hold open there without a name (rows that wait)."""
    total = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    for process in processes:
        for link in Path(f"/proc/{process}/fd").iterdir():
            target = os.readlink(link) if link.is_symlink() else ""
            if target.startswith(str(folder)) and target.endswith("(deleted)"):
                total += link.stat().st_size
    return total / 1e6


class Watcher:
    """Takes a row each time a stretch of the flight is over."""

    def __init__(self, pair: Pair, folder: Path, stretch_s: float) -> None:
        self.rows: list[Row] = []
        self._processes = [pair.processes[name].pid for name in NAMES]
        self._folder, self._stretch_s = folder, stretch_s
        self._last: tuple[float, float, list[float]] | None = None

    def look(self, event: dict[str, Any]) -> None:
        """A progress event of the plant."""
        simulated, now = event["time_s"], time.monotonic()
        if self._last is not None and simulated - self._last[0] < self._stretch_s:
            return
        spent = [cpu_s(process) for process in self._processes]
        if self._last is not None:
            ticks = (simulated - self._last[0]) * RATE_HZ
            cpu = [1e6 * (after - before) / ticks for after, before in zip(spent, self._last[2], strict=True)]
            memory = map(resident_mb, self._processes)
            logs = files_mb(self._folder, self._processes)
            row = Row(simulated / 3600.0, *memory, *cpu, 1e6 * (now - self._last[1]) / ticks, logs)
            self.rows.append(row)
            print("  ".join(f"{value:10.3f}" for value in row), flush=True)
        self._last = simulated, now, spent


def growth(rows: list[Row], name: str) -> float:
    """Median over the last quarter less that over the second."""
    values = [getattr(row, name) for row in rows]
    quarter = max(1, len(values) // 4)
    return statistics.median(values[-quarter:]) - statistics.median(values[quarter : 2 * quarter] or values)


def main() -> None:
    """Fly and judge."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--hours", type=float, default=24.0, help="of simulated time (default: 24)")
    parser.add_argument("--clock", choices=("lockstep", "realtime"), default="lockstep")
    parser.add_argument("--logs", choices=LOGS, default="usual", help="how much is kept (default: usual)")
    parser.add_argument("--out", type=Path, help="folder of the logs (default: a temporary one)")
    parser.add_argument("--table", type=Path, metavar="FILE", help="CSV to write the rows to")
    parser.add_argument(
        "--most-growth", type=float, default=5.0, metavar="MB", help="of either process (default: 5)"
    )
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        out = arguments.out or Path(folder)
        out.mkdir(parents=True, exist_ok=True)
        rows, end = _flown(arguments, out.resolve())
    if arguments.table is not None:
        with arguments.table.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([Row._fields, *rows])
    print(f"late ticks {end['late_ticks']}, lateness {end['lateness_us']} us")
    grown = {name: growth(rows, name) for name in Row._fields[1:]}
    for name, value in grown.items():
        print(f"{name}: {value:+.3f} from the second quarter to the last")
    if max(grown[f"{name}_mb"] for name in NAMES) > arguments.most_growth:
        sys.exit(f"memory grows by more than {arguments.most_growth:g} MB")


def _flown(arguments: argparse.Namespace, out: Path) -> tuple[list[Row], dict[str, Any]]:
    duration = 3600.0 * arguments.hours
    [port] = free_ports(1)
    common = ["--scenario", "hover", "--vehicle", "iris", "--rate", str(RATE_HZ)]
    common += [] if arguments.logs == "none" else ["--out", str(out), "--logs", arguments.logs]
    plant = ["--hil", f"udpout:127.0.0.1:{port}", "--clock", arguments.clock, "--duration", str(duration)]
    controller = ["--hil", f"udpin:127.0.0.1:{port}", "--feedback", "estimate"]
    print("  ".join(f"{name[:10]:>10}" for name in Row._fields))
    pair = Pair([*common, *plant], [*common, *controller])
    watcher = Watcher(pair, out, duration / STRETCHES)
    outcome = watch(pair, StopRequest(), watcher.look)
    if outcome.failure:
        sys.exit(outcome.failure)
    return watcher.rows, outcome.end


if __name__ == "__main__":
    main()
