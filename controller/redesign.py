"""Gains designed in a process of their own, so that the control loop does not miss a tick for them.

`python -m controller.redesign` is that process: a vehicle, a rate and weights in, two designs out.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np

from controller.designs import Emphasis, guided_designs
from controller.law import DESIGN, Design
from sitl_bridge.vehicle import Vehicle


class DesignProcess:
    """Makes the designs of one vehicle in the background."""

    def __init__(self, vehicle: Vehicle, rate_hz: float) -> None:
        self._vehicle = vehicle.model_dump_json()
        self._rate_hz = rate_hz
        self._process: subprocess.Popen[bytes] | None = None

    def request(self, emphasis: Emphasis) -> None:
        """Begin to design; what was under way is given up."""
        self.close()
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(sys.path)},
        )
        assert self._process.stdin is not None
        asked = {"vehicle": self._vehicle, "rate_hz": self._rate_hz, "emphasis": emphasis}
        self._process.stdin.write(json.dumps(asked).encode())
        self._process.stdin.close()

    def result(self) -> tuple[Design, Design] | str | None:
        """The designs of the last request, once, when they are there; or why there are none."""
        process = self._process
        if process is None or process.poll() is None:
            return None
        assert process.stdout is not None
        data = process.stdout.read()
        self.close()
        if process.returncode != 0 or len(data) != 2 * DESIGN.itemsize:
            return "no gains can be designed with them"
        designs = np.frombuffer(data, dtype=DESIGN).copy()
        if not all(np.isfinite(designs[name]).all() for name in ("state_gain", "integral_gain", "lag_gain")):
            return "their gains are not finite"
        return designs[:1], designs[1:]

    def close(self) -> None:
        """Give up what is under way."""
        if self._process is not None:
            if self._process.poll() is None:
                self._process.kill()
            self._process.wait()
            assert self._process.stdout is not None
            self._process.stdout.close()
        self._process = None


def main() -> None:
    """Read what is asked for, write two records of `law.DESIGN`."""
    os.nice(10)
    asked = json.load(sys.stdin)
    vehicle = Vehicle.model_validate_json(asked["vehicle"])
    loaded, alone = guided_designs(vehicle, asked["rate_hz"], Emphasis(*asked["emphasis"]))
    sys.stdout.buffer.write(loaded.tobytes() + alone.tobytes())


if __name__ == "__main__":
    main()
