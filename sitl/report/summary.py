"""What a flight leaves behind: summary.json and a picture."""

from __future__ import annotations

import hashlib
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.feedback.log import COVARIANCE_NAME, ESTIMATE_NAME
from controller.law.reference import Path as ReferencePath
from controller.pilot.terms_log import FILE_NAME as TERMS_NAME
from sitl.export.mcap import FILE_NAME as MCAP_NAME
from sitl.json_values import to_json
from sitl.recording.recording import REFERENCE_NAME, SUMMARY_NAME, VEHICLE_NAME
from sitl.report.html_report import FILE_NAME as HTML_NAME
from sitl.report.metrics import Metrics, reference_positions
from sitl.report.outcome import judge
from sitl.report.points import last_set, path_metrics
from sitl.report.sensing_error import sensing_error
from sitl_bridge.event_log import FILE_NAME as EVENTS_NAME
from sitl_bridge.mavlink.tlog import FILE_NAME as TLOG_NAME
from sitl_bridge.plant.log.account import Account
from sitl_bridge.plant.log.state_log import FILE_NAME
from sitl_bridge.vehicle.description import Vehicle

PICTURE_NAME = "flight.png"
FILES = (
    SUMMARY_NAME,
    FILE_NAME,
    TLOG_NAME,
    PICTURE_NAME,
    ESTIMATE_NAME,
    COVARIANCE_NAME,
    TERMS_NAME,
    VEHICLE_NAME,
    REFERENCE_NAME,
    MCAP_NAME,
    HTML_NAME,
    EVENTS_NAME,
)
"""Names of everything that a flight leaves in its folder."""
OF_THE_PLANT = tuple(
    key for key in Account.__annotations__ if key not in ("completed", "failure", "stopped_by")
)
"""Keys of the plant's account that go into the summary as they are; the others `sitl fly` knows better."""
PROMISED = (
    *OF_THE_PLANT,
    *Metrics.__annotations__,
    "points",
    "law",
    "outcome",
    "outcome_time_s",
    "outcome_cause",
    "estimate",
    "picture",
    "state_log_sha256",
)
"""Keys of every summary, however the flight ended: null for what is not known."""

Log = dict[str, NDArray[np.float64]]


def clear(out: Path) -> None:
    """Remove what an earlier flight has left in the folder, so that nothing of it is taken for this one's."""
    for name in FILES:
        (out / name).unlink(missing_ok=True)


def written(out: Path) -> list[Path]:
    """What a flight has left in its folder, which was cleared before it."""
    return [file for name in sorted(FILES) if (file := out / name).exists()]


def read_state_log(path: Path) -> Log:
    """Columns of a state log by name; raises ValueError when the plant did not live to finish it."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(path)
    except pa.ArrowInvalid as error:
        raise ValueError(f"{path} is not complete: {error}") from None
    return {name: np.asarray(table[name].to_numpy(), dtype=np.float64) for name in table.column_names}


def positions(log: Log, body: str) -> NDArray[np.float64]:
    """Positions (n, 3) of `vehicle` or `load`, m, world."""
    return np.stack([log[f"{body}_{axis}_m"] for axis in "xyz"], axis=1)


def write_report(
    out: Path,
    facts: dict[str, Any],
    path: ReferencePath | None,
    vehicle: Vehicle | None = None,
    described: Vehicle | None = None,
    picture: bool = True,
) -> dict[str, Any]:
    """Write summary.json and the picture next to the state log; returns the summary.

    facts: what is known besides the log; path: the reference as it was flown, None under ground control or
    when nothing has flown; vehicle: as the controller was told, where it has left a log of its estimate;
    described: as it was told in any case; picture: whether to draw one.
    """
    state_log = out / FILE_NAME
    summary = {**facts, **{key: None for key in PROMISED if key not in facts}, "settled": False}
    if state_log.exists():
        try:
            log = read_state_log(state_log)
        except ValueError as error:
            summary["failure"] = f"{facts.get('failure')}; {error}"
            log = {"time_s": np.zeros(0)}
        if len(log["time_s"]) > 1:
            reference = None if path is None else reference_positions(path, log["time_s"])
            if path is not None:
                seen = (
                    0.0
                    if described is None
                    else sensing_error(described, facts["feedback"], facts["rate_hz"])
                )
                summary |= path_metrics(path, log["time_s"], positions(log, "load"), seen)
            summary["settled"] = bool(summary["settled"] and facts.get("completed"))
            if described is not None:
                summary |= judge(log, reference, described, summary)._asdict()
            if vehicle is not None and path is not None and (out / ESTIMATE_NAME).exists():
                summary["estimate"] = estimate_report(out, log, path, vehicle, facts["rate_hz"])
            if picture:
                draw(out / PICTURE_NAME, log, reference, facts)
                summary["picture"] = str(out / PICTURE_NAME)
        summary["state_log"] = str(state_log)
        summary["state_log_sha256"] = hashlib.sha256(state_log.read_bytes()).hexdigest()
    summary["settled"] = bool(summary["settled"] and facts.get("completed"))
    summary = {key: to_json(value) for key, value in summary.items()}  # a flight that diverged has no figures
    write_summary(out, summary)
    return summary


def write_summary(out: Path, summary: dict[str, Any]) -> None:
    """Write summary.json."""
    text = json.dumps(summary, indent=2, allow_nan=False)
    (out / SUMMARY_NAME).write_text(text + "\n", encoding="utf-8")


def without_files(summary: dict[str, Any]) -> dict[str, Any]:
    """The summary of a flight whose logs were not kept: without their paths."""
    of_estimate = summary.get("estimate")
    if of_estimate is not None:
        of_estimate = {**of_estimate, "estimate_log": None, "covariance_log": None}
    return {**summary, "state_log": None, "tlog": None, "estimate": of_estimate}


def estimate_report(
    out: Path, log: Log, path: ReferencePath, vehicle: Vehicle, rate_hz: float
) -> dict[str, Any] | None:
    """`estimate` of the summary, with the bound of the linear filter; None when its log is not complete."""
    from controller.estimator.riccati_bound import load_relative_bound
    from controller.feedback.estimate import tuning_for
    from sitl.report.estimate_metrics import estimate_metrics

    try:
        estimates, covariances = (read_state_log(out / name) for name in (ESTIMATE_NAME, COVARIANCE_NAME))
    except (OSError, ValueError):
        return None
    reference = reference_positions(path, log["time_s"])
    bound = load_relative_bound(vehicle, 1.0 / rate_hz, tuning_for(vehicle, rate_hz))
    return {
        **estimate_metrics(log, estimates, covariances, reference, last_set(path)),
        "load_relative_bound_m": bound.tolist(),
        "estimate_log": str(out / ESTIMATE_NAME),
        "covariance_log": str(out / COVARIANCE_NAME),
    }


_SHADES = 64
"""Of the picture: lines in few colours take a quarter of the size that true colours do."""


def draw(file: Path, log: Log, reference: NDArray[np.float64] | None, facts: dict[str, Any]) -> None:
    """Picture of a flight: load and vehicle against the reference, cable length, rotor speeds."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt
    from PIL import Image

    time = log["time_s"]
    load, vehicle = positions(log, "load"), positions(log, "vehicle")
    figure, axes = plt.subplots(5, 1, figsize=(9, 11), sharex=True, layout="constrained")
    for index, axis in enumerate("xyz"):
        ax = axes[index]
        if reference is not None:
            ax.plot(time, reference[:, index], "k--", lw=1.2, label="reference (load)")
        ax.plot(time, load[:, index], color="tab:orange", lw=1.8, label="load")
        ax.plot(time, vehicle[:, index], color="tab:blue", lw=1.2, label="vehicle")
        ax.set_ylabel(f"{axis} [m]")
    axes[0].legend(loc="lower right", ncols=3, fontsize="small")
    axes[3].plot(time, log["cable_length_m"], color="tab:green", lw=1.5)
    axes[3].set_ylabel("cable length [m]")
    rotors = [name for name in log if name.startswith("rotor_")]
    for number, name in enumerate(rotors, 1):
        axes[4].plot(time, log[name], lw=0.8, label=f"rotor {number}")
    axes[4].set_ylabel("rotor speed [rad/s]")
    axes[4].legend(loc="upper right", ncols=min(8, len(rotors)), fontsize="small")
    axes[4].set_xlabel("time [s]")
    for ax in axes:
        ax.grid(alpha=0.3)
    flies = f"law {facts['law']['name']}" if facts.get("law") else f"{facts['design']} design"
    figure.suptitle(
        f"{facts['scenario']}: vehicle {facts['vehicle']}, {flies}, "
        f"{facts['clock']} at {facts['rate_hz']:g} Hz"
    )
    if file.suffix.lower() != ".png":
        figure.savefig(file, dpi=110)
        plt.close(figure)
        return
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=110, format="png")
    plt.close(figure)
    few = Image.open(drawn).convert("RGB").quantize(_SHADES, dither=Image.Dither.NONE)
    few.save(file, "png", optimize=True)
