"""The table of docs/estimator.md: flights over the link in lockstep, plant and controller as two processes.

    python scripts/estimator_table.py --seeds 20 --duration 120 --out runs/estimator

Vehicle `paper` in hover under 5 N of white force. What lies in --out already is not flown again.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
from sitl.flights.free_ports import free_ports  # noqa: E402

INDEPENDENT_TIME = 10.0
"""s after which errors are taken as independent, for the bounds of NEES."""
NEES_STATES = 15
SKIPPED = 20.0
"""s, left out of all figures."""


class Case(NamedTuple):
    """A row: what flies on what, and the accuracy that it should reach (m), per seed half as much again."""

    rest_length: float
    sensors: str
    feedback: str
    relative: tuple[float, float, float] | None
    absolute: float | None


CASES = (
    Case(1.0, "consumer", "truth", (0.020, 0.020, 0.010), None),
    Case(10.0, "consumer", "truth", (0.070, 0.070, 0.010), None),
    Case(1.0, "consumer", "estimate", None, 0.15),
    Case(10.0, "consumer", "estimate", None, 0.18),
    Case(1.0, "rtk", "estimate", None, 0.04),
    Case(10.0, "rtk", "estimate", None, 0.09),
)
WORST_SEED = 1.5


def summary_of(case: Case, seed: int, duration: float, out: Path) -> dict[str, Any]:
    """Fly one flight, unless it has been flown; its summary."""
    folder = out / f"{case.feedback}-{case.sensors}-{case.rest_length:g}-{seed}-{duration:g}"
    summary = folder / "summary.json"
    if not summary.exists() or not json.loads(summary.read_text())["completed"]:
        [port] = free_ports(1)
        command = [sys.executable, "-m", "sitl", "fly", "hover", "--clock", "lockstep", "--out", str(folder)]
        command += ["--feedback", case.feedback, "--sensors", case.sensors, "--seed", str(seed)]
        command += ["--set", "disturbance.force_std=5", "--set", f"cable.rest_length={case.rest_length}"]
        command += ["--duration", str(duration), "--hil", f"udpout:127.0.0.1:{port}"]
        subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
        for log in folder.glob("*.parquet"):
            log.unlink()
        for log in folder.glob("*.tlog"):
            log.unlink()
    found: dict[str, Any] = json.loads(summary.read_text())
    if not found["completed"]:
        raise RuntimeError(f"{folder}: {found['failure']}")
    return found


def row_of(case: Case, seeds: int, duration: float, out: Path) -> dict[str, Any]:
    """Root mean square over the seeds, the worst seed, consistency, and whether the limits are met."""
    figures = [summary_of(case, seed, duration, out)["estimate"] for seed in range(seeds)]
    relative = np.array([f["load_relative_rms_m"] for f in figures])
    absolute = np.array([f["load_rms_m"] for f in figures])
    nees = np.array([f["nees_mean"] for f in figures])
    samples = NEES_STATES * seeds * (duration - SKIPPED) / INDEPENDENT_TIME
    met = []
    for values, limit in ((relative, case.relative), (absolute, case.absolute)):
        if limit is not None:
            over_seeds = np.sqrt(np.mean(values**2, axis=0))
            met += [np.all(over_seeds <= limit), np.all(values.max(axis=0) <= WORST_SEED * np.array(limit))]
    return {
        **case._asdict(),
        "relative_m": np.sqrt(np.mean(relative**2, axis=0)).tolist(),
        "relative_worst_m": relative.max(axis=0).tolist(),
        "bound_m": figures[0]["load_relative_bound_m"],
        "absolute_m": np.sqrt(np.mean(absolute**2, axis=0)).tolist(),
        "absolute_worst_m": absolute.max(axis=0).tolist(),
        "nees": float(nees.mean()),
        "nees_bound": 1.96 * math.sqrt(2.0 / samples),
        "innovations": float(np.mean([f["innovations_in_bounds"] for f in figures])),
        "met": bool(all(met)),
    }


def centimetres(values: list[float]) -> str:
    """x/y/z in cm."""
    return "/".join(f"{100 * value:.2f}" for value in values)


def main() -> None:
    """Fly, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--duration", type=float, default=120.0)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    print(
        "| l₀ / m | sensors | law flies on | seeds | load relative to vehicle, rms / cm | worst seed "
        "| Riccati bound | load from reference, rms / cm | worst seed | NEES (95 %) "
        "| innovations within 95 % | limits |"
    )
    print("|" + 12 * "---|", flush=True)
    for case in CASES:
        row = row_of(case, arguments.seeds, arguments.duration, arguments.out.resolve())
        print(
            f"| {case.rest_length:g} | {case.sensors} | {case.feedback} | {arguments.seeds} "
            f"| {centimetres(row['relative_m'])} "
            f"| {centimetres(row['relative_worst_m'])} | {centimetres(row['bound_m'])} "
            f"| {centimetres(row['absolute_m'])} | {centimetres(row['absolute_worst_m'])} "
            f"| {row['nees']:.3f} (1 ± {row['nees_bound']:.3f}) | {100 * row['innovations']:.1f} % "
            f"| {'met' if row['met'] else 'NOT met'} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
