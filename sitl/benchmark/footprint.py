"""What a flight takes besides time: memory of its processes, and disk for its logs."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path
from typing import Any

from sitl.api import fly
from sitl.flights.free_ports import free_ports
from sitl.flights.launch import FlightError, Pair, watch
from sitl_bridge.process import StopRequest

LOGGED_S = 60.0
"""One minute: figures are megabytes a minute."""
WATCHED_S = 30.0


def memory_figures() -> dict[str, float]:
    """Most memory of plant and controller, MB, in a flight of `iris` on the estimate with its logs."""
    [port] = free_ports(1)
    common = ["--scenario", "hover", "--vehicle", "iris"]
    plant = ["--hil", f"udpout:127.0.0.1:{port}", "--clock", "lockstep", "--duration", str(WATCHED_S)]
    controller = ["--hil", f"udpin:127.0.0.1:{port}", "--feedback", "estimate"]
    most: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        out = ["--out", folder]
        pair = Pair([*common, *plant, *out], [*common, *controller, *out])

        def look(event: dict[str, Any]) -> None:
            for name, child in pair.processes.items():
                found = peak_memory_mb(child.pid)
                if found is not None:
                    most[f"memory_mb_{name}"] = found

        outcome = watch(pair, StopRequest(), look)
    if outcome.failure:
        raise FlightError(outcome.failure)
    return most


def peak_memory_mb(process: int) -> float | None:
    """Most memory that a process has had in use so far, MB; None where the system does not say (no Linux)."""
    try:
        status = Path(f"/proc/{process}/status").read_text()
    except OSError:
        return None
    found = re.search(r"^VmHWM:\s+(\d+) kB", status, flags=re.MULTILINE)
    return None if found is None else int(found[1]) * 1024 / 1e6


def log_figures() -> dict[str, float]:
    """All that a minute of flight leaves by default, MB: `paper` on truth, `iris` on the estimate."""
    return {
        "logs_mb_per_min": _logs_mb("setpoint", None),
        "logs_mb_per_min_estimate": _logs_mb("hover", "iris"),
    }


def _logs_mb(scenario: str, vehicle: str | None) -> float:
    with tempfile.TemporaryDirectory() as folder:
        fly(scenario, vehicle=vehicle, duration_s=LOGGED_S, out=folder)
        return sum(file.stat().st_size for file in Path(folder).iterdir()) / 1e6
