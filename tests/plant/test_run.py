"""The plant's process around its clock: what it says and logs of a run."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.mavlink.tlog import TlogWriter
from sitl_bridge.plant import run
from sitl_bridge.plant.physics.state import STOPPED
from sitl_bridge.process import Speaker, StopRequest
from sitl_bridge.vehicle.files import load_vehicle


def options(out: Path, **more: Any) -> run.PlantOptions:
    return run.PlantOptions(
        load_vehicle("paper"), Address("udpin", "127.0.0.1", 0), "lockstep", 250.0, 0, 0, out=out, **more
    )


def test_closing_the_logs_is_no_part_of_the_real_time_factor(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def flies(clock: Any, *others: Any) -> None:
        clock.simulation.begin()
        for _ in range(250):
            clock.simulation.step(STOPPED)

    def closes(log: TlogWriter) -> None:
        time.sleep(2.0)

    monkeypatch.setattr(run, "_loop", flies)
    monkeypatch.setattr(TlogWriter, "close", closes)
    account = run.run(options(tmp_path), Speaker("plant", events=False), StopRequest())
    assert account["time_s"] == pytest.approx(1.0)
    assert account["real_time_factor"] is not None
    assert account["real_time_factor"] > 0.6
