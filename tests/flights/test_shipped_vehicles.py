"""The `default` design on every shipped vehicle, rotors' lag included: margin, and a step."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from controller.design.catalogue import design
from controller.design.margins import closed_loop_matrix, delay_margin, spectral_radius
from controller.design.model import actuated_model
from sitl_bridge.vehicle.files import load_vehicle, vehicle_names

RATE = 250.0
STEP = 3.0  # m
Fly = Callable[..., dict[str, Any]]
every_vehicle = pytest.mark.parametrize("name", vehicle_names())


@every_vehicle
def test_at_least_20_ms_of_delay_margin(name: str) -> None:
    vehicle = load_vehicle(name)
    model, record = actuated_model(vehicle), design("default", vehicle, RATE)
    assert spectral_radius(closed_loop_matrix(model, record)) < 1.0
    for inputs in ((0,), (1,), (2,), (3,), (0, 1, 2, 3)):
        assert delay_margin(model, record, inputs, longest=0.02) == 0.02, inputs


@every_vehicle
def test_a_step_settles_without_saturating(name: str, fly: Fly, tmp_path: Path) -> None:
    vehicle = load_vehicle(name)
    x, y, z = vehicle.initial.load_position
    file = tmp_path / "step.toml"
    file.write_text(
        f'vehicle = "{name}"\nset = ["initial.start=hover"]\nduration = 30.0\n'
        f'[reference]\nkind = "setpoint"\nposition = [{x + STEP}, {y}, {z}]\n'
    )
    summary = fly(str(file), "--feedback", "truth")  # the design's own settling, not the sensors' noise
    assert summary["settled"]
    log = pq.read_table(summary["state_log"])
    largest = np.array([rotor.max_speed for rotor in vehicle.rotors])
    commanded = np.array([log[f"rotor_{i + 1}_rad_s"].to_numpy() for i in range(len(largest))]).T
    assert len(commanded) > 7000
    saturated = ((commanded >= 0.999 * largest) | (commanded <= 0.001 * largest)).any(axis=1)
    assert saturated.sum() / RATE <= 0.5
