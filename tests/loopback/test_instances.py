"""Eight plants and controllers side by side on one machine, in lockstep, on their default ports."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from sitl_bridge.mavlink.framing import split
from tests.loopback.conftest import Process

COUNT = 8
FIRST = 40
"""Instances that nothing else on this machine is likely to use."""


def test_eight_side_by_side(start: Callable[..., Process], tmp_path: Path) -> None:
    flights = []
    for instance in range(FIRST, FIRST + COUNT):
        common = ["--scenario", "setpoint", "--instance", str(instance), "--seed", "5"]
        out = tmp_path / str(instance)
        plant = start("plant", *common, "--clock", "lockstep", "--duration", "1", "--json", "--out", str(out))
        flights.append((instance, plant, start("controller", *common), out))
    logs = set()
    for instance, plant, controller, out in flights:
        code, output, errors = plant.finish()
        assert code == 0, errors
        assert json.loads(output)["completed"]
        assert "ignored" not in errors  # nobody heard another's autopilot
        controller.close()
        log = pq.read_table(out / "state.parquet")
        logs.add(np.array([column.to_numpy() for column in log.columns]).tobytes())
        frames = split((out / "link.tlog").read_bytes()[:65536]).frames
        assert {frame.system for frame in frames} == {instance + 1, instance + 101}
    assert len(logs) == 1  # the same flight, eight times
