"""Gains for a longer delay, from those for a shorter one."""

from __future__ import annotations

import numpy as np
import pytest

from controller.design.catalogue import guided_designs
from controller.design.later import acting_later, follow
from controller.law.control_law import engaged_memory
from sitl_bridge.vehicle.files import load_vehicle

RATE_HZ = 250.0


@pytest.mark.parametrize("vehicle", ["paper", "iris"])  # without and with lagging rotors
@pytest.mark.parametrize("loaded", [True, False])
def test_they_are_those_that_a_design_for_that_delay_has(vehicle: str, loaded: bool) -> None:
    which = 0 if loaded else 1
    prompt = load_vehicle(vehicle, ["loop.delay_ticks=2"])
    told = guided_designs(load_vehicle(vehicle, ["loop.delay_ticks=15"]), RATE_HZ)[which]
    found = acting_later(guided_designs(prompt, RATE_HZ)[which], prompt, 15, loaded)
    assert told.dtype.names is not None
    for name in told.dtype.names:
        if name == "soft":  # under ground control the gains are the soft ones anyway
            assert found[name].tobytes() == told[name].tobytes()
        elif name != "body":
            np.testing.assert_allclose(
                found[name], told[name], rtol=1e-9, atol=1e-9 * np.abs(told[name]).max()
            )


def test_a_shorter_delay_changes_nothing() -> None:
    vehicle = load_vehicle("iris", ["loop.delay_ticks=3"])
    design = guided_designs(vehicle, RATE_HZ)[0]
    assert acting_later(design, vehicle, 2).tobytes() == design.tobytes()


def test_what_lagging_rotors_give_is_worked_out_from_older_commands() -> None:
    vehicle = load_vehicle("iris")
    later = acting_later(guided_designs(vehicle, RATE_HZ)[0], vehicle, 10)
    memory = engaged_memory(np.zeros(3))
    memory["past"][0, :10] = 7.0  # these are still under way; the tenth acts now
    memory["past"][0, 10:] = 2.0
    follow(later, memory)
    decay = float(later["lag_decay"][0])
    np.testing.assert_allclose(memory["rotors"][0], 2.0 * decay + 7.0 * (1.0 - decay), rtol=1e-4)
