"""The pytest plugin: one line, `def test_mine(sitl_vehicle): …`, and a vehicle stands on free ports."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from sitl.testing import SimulatedVehicle, flying_vehicle


@pytest.fixture
def sitl_vehicle(tmp_path: Path) -> Iterator[SimulatedVehicle]:
    """A simulated vehicle with its load, on the ground, disarmed, waiting for ground control."""
    with flying_vehicle(tmp_path / "vehicle") as vehicle:
        yield vehicle
