"""Flies the same step over a PX4 SITL by the law and by PX4's own position control; table and picture.

python scripts/compare_over_px4.py BUILD --out DIR

BUILD: folder of a PX4 SITL that is built (build/px4_sitl_default); PX4 is started anew for each flight.
Writes DIR/comparison.md, DIR/comparison.png and the folder of each flight. `--again` draws from flights that
are there.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

METHODS = {
    "law": ((), "our law on the load"),
    "motion": (("--baseline", "motion"), "PX4's position control, fed the smooth motion"),
    "point": (("--baseline", "point"), "PX4's position control, raw set-point"),
}
SCENARIO = """description = "The load 3 m to the east"
vehicle = "iris"
duration = 16.0
[reference]
kind = "setpoint"
position = [3.0, 0.0, 2.5]
"""
PARAMETERS = {"THR_MDL_FAC": "1", "MPC_THR_HOVER": "0.62"}
"""Of PX4, for this plant; see docs/px4.md."""
COLUMNS = (
    ("within_10pct_s", "within 10 %", "s", 2),
    ("within_5pct_s", "within 5 %", "s", 2),
    ("overshoot_m", "overshoot", "m", 3),
    ("largest_swing_deg", "largest swing", "°", 1),
    ("residual_swing_rms_deg", "residual swing, rms", "°", 2),
    ("residual_error_rms_m", "residual error, rms", "m", 3),
)


@contextmanager
def px4(build: Path, instance: int) -> Iterator[None]:
    """A PX4 SITL in a working directory of its own, with our parameters."""
    with tempfile.TemporaryDirectory() as folder, open(os.devnull, "wb") as nowhere:
        process = subprocess.Popen(
            [str(build / "bin" / "px4"), "-i", str(instance), "-d", str(build / "etc"), "-w", folder],
            cwd=folder,
            env={**os.environ, "PX4_SIM_MODEL": "none_iris"},
            stdout=nowhere,
            stderr=nowhere,
        )
        try:
            for name, value in PARAMETERS.items():
                _set(build, instance, name, value)
            yield
        finally:
            process.terminate()
            process.wait()


def _set(build: Path, instance: int, name: str, value: str) -> None:
    """By PX4's own client, which needs a PX4 that has started: tried for a while."""
    command = [str(build / "bin" / "px4-param"), "--instance", str(instance), "set", name, value]
    for _ in range(40):
        if subprocess.run(command, capture_output=True, timeout=20).returncode == 0:
            return
        time.sleep(0.5)
    raise SystemExit(f"PX4 does not take {name} = {value}; does {command[0]} run by hand?")


def fly(build: Path, arguments: argparse.Namespace, method: str, seed: int, out: Path) -> None:
    """One flight into a folder."""
    scenario = arguments.out / "step.toml"
    flags, _ = METHODS[method]
    command = [
        *(sys.executable, "-m", "sitl", "fly", str(scenario), "--vehicle", "iris"),
        *("--sensors", arguments.sensors, "--load", arguments.load, "--over", "udpin"),
        *("--instance", str(arguments.instance), "--seed", str(seed), "--out", str(out), *flags),
    ]
    plant = subprocess.Popen(command, stdout=subprocess.DEVNULL)  # first: PX4 waits for it in vain else
    with px4(build, arguments.instance):
        plant.wait()


def figures(out: Path) -> dict[str, float | None] | None:
    """`over` of a flight's summary; None when it did not come to its end."""
    summary = json.loads((out / "summary.json").read_text())
    return summary["over"] if summary["completed"] else None


def table(found: dict[str, list[dict[str, Any]]]) -> str:
    """Markdown: median and worst of each figure for each method."""
    lines = ["| | " + " | ".join(METHODS[m][1] for m in found) + " |", "|---" * (len(found) + 1) + "|"]
    flights = " | ".join(str(len(rows)) for rows in found.values())
    for key, title, unit, digits in COLUMNS:
        cells = [_cell([row.get(key) for row in rows], unit, digits) for rows in found.values()]
        lines.append(f"| {title} | " + " | ".join(cells) + " |")
    return "\n".join([*lines, f"| flights | {flights} |"]) + "\n"


def _cell(values: list[float | None], unit: str, digits: int) -> str:
    """Median (worst); a value that there is not is the worst."""
    numbers = [math.inf if value is None else value for value in values]
    if not numbers:
        return "-"
    texts = [
        "never" if math.isinf(v) else f"{v:.{digits}f} {unit}"
        for v in (statistics.median(numbers), max(numbers))
    ]
    return texts[0] if texts[0] == texts[1] else f"{texts[0]} ({texts[1]})"


def draw(folders: dict[str, list[Path]], file: Path) -> None:
    """Distance of the load from its goal, and its swing, of every flight."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, (top, bottom) = plt.subplots(2, 1, figsize=(9, 7), sharex=True, layout="constrained")
    colours = {"law": "tab:blue", "motion": "tab:orange", "point": "tab:red"}
    for method, flights in folders.items():
        for number, folder in enumerate(flights):
            log = pq.read_table(folder / "state.parquet")
            at = {
                body: np.stack([log[f"{body}_{axis}_m"].to_numpy() for axis in "xyz"], axis=1)
                for body in ("vehicle", "load")
            }
            times, up = log["time_s"].to_numpy(), at["vehicle"] - at["load"]
            style = {"color": colours[method], "lw": 1.0, "alpha": 0.8}
            label = METHODS[method][1] if not number else None
            top.plot(times, at["load"][:, 0], label=label, **style)
            swing = np.degrees(np.arctan2(np.hypot(up[:, 0], up[:, 1]), up[:, 2]))
            bottom.plot(times, swing, **style)
    top.axhline(3.0, color="0.4", lw=0.8, ls="--")
    top.set(ylabel="load, east [m]", title="The load 3 m to the east, over a stock PX4")
    top.legend(loc="lower right", fontsize="small")
    bottom.set(ylabel="swing [°]", xlabel="time since the step [s]", ylim=(0, None))
    for axes in (top, bottom):
        axes.grid(alpha=0.3)
    figure.savefig(file, dpi=110)


def main() -> None:
    """Fly what is asked for, and report."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("build", type=Path, help="PX4's build/px4_sitl_default")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=5, help="flights of each method (default: 5)")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument("--sensors", default="rtk")
    parser.add_argument("--load", default="truth")
    parser.add_argument("--instance", type=int, default=0)
    parser.add_argument("--again", action="store_true", help="only table and picture of what is there")
    arguments = parser.parse_args()
    if not (arguments.build / "bin" / "px4").exists() and not arguments.again:
        parser.error(f"{arguments.build}: no bin/px4; expected PX4's build/px4_sitl_default")
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "step.toml").write_text(SCENARIO)
    folders: dict[str, list[Path]] = {method: [] for method in arguments.methods}
    found: dict[str, list[dict[str, Any]]] = {method: [] for method in arguments.methods}
    for seed in range(1, arguments.seeds + 1):
        for method in arguments.methods:
            out = arguments.out.resolve() / f"{method}-{seed}"
            if not arguments.again:
                shutil.rmtree(out, ignore_errors=True)
                print(f"{method}, seed {seed}", file=sys.stderr, flush=True)
                fly(arguments.build.resolve(), arguments, method, seed, out)
            flown = figures(out) if (out / "summary.json").exists() else None
            if flown is None:
                print(f"{out}: not flown to its end, not counted", file=sys.stderr)
            else:
                folders[method].append(out)
                found[method].append(flown)
    text = table(found)
    (arguments.out / "comparison.md").write_text(text)
    draw(folders, arguments.out / "comparison.png")
    print(text)


if __name__ == "__main__":
    main()
