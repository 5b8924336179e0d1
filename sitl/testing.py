"""A vehicle for your own tests: `with flying_vehicle(folder) as vehicle: … connect to vehicle.mavsdk …`.

Two real processes on free ports of 127.0.0.1, on the ground and disarmed. As a pytest plugin (installed with
the package) this is the fixture `sitl_vehicle`.
"""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from sitl.flights.free_ports import free_ports

START_PATIENCE = 120.0
"""s without another line from the vehicle; a first start says each part that it compiles"""
STOP_PATIENCE = 120.0


@dataclass(frozen=True)
class SimulatedVehicle:
    """Addresses of a running vehicle, and the files that it leaves."""

    mavsdk: str
    """Connection string for the first MAVSDK client"""
    mavproxy: str
    """Connection string for the first ground station: `--master` of MAVProxy, or for pymavlink"""
    ground: str
    """Connection string for each further ground station, for pymavlink (`udpout:…`)"""
    companion: str
    """Connection string for each further companion or MAVSDK client (`udpout://…`)"""
    state_log: Path
    """The true states, a Parquet file; there is one once the vehicle has stopped"""
    log: Path
    """Text file with the messages of the processes"""


@contextlib.contextmanager
def flying_vehicle(
    folder: Path,
    arguments: Sequence[str] = ("--clock", "lockstep", "--speed", "1"),
    parameters: Mapping[str, float] | None = None,
    scenario: str = "hold",
) -> Iterator[SimulatedVehicle]:
    """Start a vehicle that waits for ground control. A context manager: the vehicle stops at its end.

    Arguments:
        folder: for the logs; it is made if it does not exist.
        arguments: further arguments of `sitl fly`. With the default, plant and controller wait for each
            other: a busy machine makes the flight slower, not different.
        parameters: the autopilot's parameters to start with, by name.
        scenario: one that leaves the flight to ground control, by name or .toml file.

    Raises RuntimeError, with what the vehicle said, if it does not start.
    """
    hil, gcs, gcs_peer, onboard, onboard_peer = free_ports(5)
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "sitl.txt"
    stored = folder / "parameters.json"
    # A test's machine may be busy: a pause of the processes is no lost link.
    stored.write_text(json.dumps({"COM_HIL_LOSS_T": 10.0, **(parameters or {})}))
    command = [sys.executable, "-m", "sitl", "fly", scenario, *arguments]
    command += ["--hil", f"udpout:127.0.0.1:{hil}", "--gcs", f"{gcs}:{gcs_peer}"]
    command += ["--onboard", f"{onboard}:{onboard_peer}", "--parameters", str(stored)]
    command += ["--out", str(folder), "--no-report"]
    with log.open("wb") as said:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=said, stderr=said)
        try:
            _wait_for(process, log, "plant connected")
            yield SimulatedVehicle(
                f"udpin://127.0.0.1:{onboard_peer}",
                f"udpin:127.0.0.1:{gcs_peer}",
                f"udpout:127.0.0.1:{gcs}",
                f"udpout://127.0.0.1:{onboard}",
                folder / "state.parquet",
                log,
            )
        finally:
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(STOP_PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _wait_for(process: subprocess.Popen[bytes], log: Path, text: str) -> None:
    """Wait for a text in the log. Raises RuntimeError when the process ends, or says nothing new for long."""
    seen, deadline = "", time.monotonic() + START_PATIENCE
    while text not in (said := log.read_text(errors="replace")):
        if said != seen:
            seen, deadline = said, time.monotonic() + START_PATIENCE
        if process.poll() is not None or time.monotonic() > deadline:
            raise RuntimeError(f"the vehicle did not start:\n{said}")
        time.sleep(0.05)
