"""The viewer of a flight as a process of its own: `--view`."""

from __future__ import annotations

import contextlib
import importlib.util
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from sitl.flights.free_ports import free_ports
from sitl.recording.recording import VEHICLE_NAME, write_vehicle
from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import DescriptionError

PATIENCE = 20.0
"""How long the viewer may take to stop before it is killed, s."""


def check_installed() -> None:
    """Raises DescriptionError, before anything is launched, where there is no viewer."""
    if importlib.util.find_spec("viser") is None:
        raise DescriptionError(
            "--view", ["needs viser: pip install 'sitl-bridge[view]' (or: pip install viser)"]
        )


@contextlib.contextmanager
def viewer(
    vehicle: Vehicle, more: Sequence[Address] = (), scenario: str | None = None
) -> Iterator[tuple[str, int]]:
    """Run a viewer; gives the host and port that it hears the truth on.

    more: other links that it is to listen on. scenario: name or file of what is flown.
    A viewer that ends, or never starts, is nobody's concern.
    """
    [port] = free_ports(1)
    with tempfile.TemporaryDirectory() as folder:
        write_vehicle(Path(folder), vehicle)
        command = [sys.executable, "-m", "sitl", "view", f"udpin:127.0.0.1:{port}", *map(str, more)]
        command += ["--vehicle", str(Path(folder) / VEHICLE_NAME), "--until-eof"]
        if scenario is not None:
            command += ["--scenario", scenario]
        child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
        try:
            yield "127.0.0.1", port
        finally:
            assert child.stdin is not None
            child.stdin.close()  # it stops when its standard input ends
            try:
                child.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()
