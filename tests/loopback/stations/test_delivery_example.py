"""examples/delivery.py, step by step: MAVSDK's gripper and winch set the load down 12 m away."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as parquet
import pytest

from sitl.testing import flying_vehicle
from tests.patience import LONG_PATIENCE

EXAMPLE = Path(__file__).parents[3] / "examples" / "delivery.py"


def test_the_example_delivers_and_lands(tmp_path: Path) -> None:
    arguments = ("--sensors", "rtk", "--clock", "lockstep", "--speed", "4")
    with flying_vehicle(tmp_path, arguments) as vehicle:
        command = [sys.executable, str(EXAMPLE), vehicle.mavsdk]
        done = subprocess.run(command, capture_output=True, text=True, timeout=LONG_PATIENCE, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    for line in ("the load is on the ground", "delivered", "landed"):
        assert line in done.stdout
    flown = parquet.read_table(vehicle.state_log)
    last = flown.slice(flown.num_rows - 1).to_pylist()[0]
    assert last["load_y_m"] == pytest.approx(12.0, abs=0.5)
    assert last["load_z_m"] == pytest.approx(0.05, abs=0.02)
    assert abs(last["vehicle_y_m"]) < 2.0
    assert last["vehicle_z_m"] < 0.2
